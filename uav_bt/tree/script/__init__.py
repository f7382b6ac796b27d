"""The scripting language of tree files: a small parser and interpreter, bounded, no `eval`."""

from uav_bt.tree.script.parser import Script, parse_question, parse_script
from uav_bt.tree.script.values import Environment, ScriptError

SCRIPTS = frozenset({parse_script, parse_question})
"""The checks of ports whose value is a script."""

__all__ = ["SCRIPTS", "Environment", "Script", "ScriptError", "parse_question", "parse_script"]
