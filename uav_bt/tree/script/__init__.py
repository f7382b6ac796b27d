"""The scripting language of tree files: a small parser and interpreter, bounded, no `eval`."""

from uav_bt.tree.script.parser import Script, fill_text, parse_question, parse_script, parse_text
from uav_bt.tree.script.values import Environment, ScriptError

SCRIPTS = frozenset({parse_script, parse_question, parse_text})
"""The checks of ports whose value is a script, or a text with names."""

__all__ = [
    "SCRIPTS",
    "Environment",
    "Script",
    "ScriptError",
    "fill_text",
    "parse_question",
    "parse_script",
    "parse_text",
]
