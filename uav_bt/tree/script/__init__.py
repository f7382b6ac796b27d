"""The scripting language of tree files: a small parser and interpreter, bounded, no `eval`."""

from uav_bt.tree.script.parser import Script, parse_question, parse_script
from uav_bt.tree.script.text import fill_text, parse_text
from uav_bt.tree.script.values import Environment, ScriptError

SCRIPTS = frozenset({parse_script, parse_question, parse_text})
"""The checks of ports whose value is a script, or a text with names."""


def parsed_by(check: object, source: str) -> Script:
    """Return the script of a port's value by the port's check, one of `SCRIPTS`."""
    return parse_text(source) if check is parse_text else parse_script(source)


__all__ = [
    "SCRIPTS",
    "Environment",
    "Script",
    "ScriptError",
    "fill_text",
    "parse_question",
    "parse_script",
    "parse_text",
    "parsed_by",
]
