"""The scripting language of tree files: a small parser and interpreter, bounded, no `eval`."""

from uav_bt.tree.script.parser import Script, parse_script
from uav_bt.tree.script.values import Environment, ScriptError

__all__ = ["Environment", "Script", "ScriptError", "parse_script"]
