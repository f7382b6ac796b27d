"""Pre- and post-conditions: scripts in a node's attributes that run around its tick."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from uav_bt.tree.script import Environment, Script, ScriptError, parse_question, parse_script
from uav_bt.tree.script.values import truth
from uav_bt.tree.status import FAILURE, IDLE, RUNNING, SKIPPED, SUCCESS, Status

# In the engine's order, each with the status that a true one gives the node.
_FORESTALLING: Final = {"_failureIf": FAILURE, "_successIf": SUCCESS, "_skipIf": SKIPPED}
ASKED: Final = frozenset({*_FORESTALLING, "_while"})
"""The conditions whose value must be true or false."""

CONDITION_ATTRIBUTES: Final = ASKED | {"_onSuccess", "_onFailure", "_post", "_onHalted"}


def check_condition(text: str) -> str | None:
    """Return the error of a condition's script, or None."""
    try:
        parse_question(text)
    except ScriptError as error:
        return str(error)
    return None


class Conditions:
    """The conditions of one node, from its scripts by attribute."""

    def __init__(self, given: Mapping[str, str]) -> None:
        self.scripts: dict[str, Script] = {name: parse_script(text) for name, text in given.items()}
        self._forestalling = [
            (self.scripts[name], status)
            for name, status in _FORESTALLING.items()
            if name in self.scripts
        ]
        self._while = self.scripts.get("_while")

    def forestall(self, standing: Status, environment: Environment) -> Status | None:
        """Return the status that replaces the node's tick, or None to tick the node.

        A running node is only asked `_while`; when that answers SKIPPED, the caller halts the node.
        """
        if standing is IDLE:
            for script, status in self._forestalling:
                if truth(script.run(environment)):
                    return status
        elif standing is not RUNNING:
            return None
        if self._while is not None and not truth(self._while.run(environment)):
            return SKIPPED
        return None

    def ended(self, status: Status, environment: Environment) -> None:
        """Run what belongs to an end with SUCCESS or FAILURE."""
        self._run("_onSuccess" if status is SUCCESS else "_onFailure", environment)
        self._run("_post", environment)

    def halted(self, environment: Environment) -> None:
        """Run what belongs to a halt."""
        self._run("_onHalted", environment)

    def _run(self, name: str, environment: Environment) -> None:
        script = self.scripts.get(name)
        if script is not None:
            script.run(environment)
