"""The scripting language of tree files: a small parser and interpreter, bounded, no `eval`."""
<<<<<<< HEAD

from uav_bt.tree.script.parser import Script as Script
from uav_bt.tree.script.parser import fill_text as fill_text
from uav_bt.tree.script.parser import parse_question as parse_question
from uav_bt.tree.script.parser import parse_script as parse_script
from uav_bt.tree.script.parser import parse_text as parse_text
from uav_bt.tree.script.values import Environment as Environment
from uav_bt.tree.script.values import ScriptError as ScriptError

SCRIPTS = frozenset({parse_script, parse_question, parse_text})
"""The checks of ports whose value is a script, or a text with names."""
=======
>>>>>>> u-engine
