"""Pre- and post-conditions: scripts in a node's attributes that run around its tick."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from uav_bt.tree.script import Environment, Script, ScriptError, parse_question, parse_script
from uav_bt.tree.script.values import truth
from uav_bt.tree.status import FAILURE, IDLE, RUNNING, SKIPPED, SUCCESS, Status

# In the engine's order, each with the status that a true one gives the node.
_FORESTALLING: Final = (("_failureIf", FAILURE), ("_successIf", SUCCESS), ("_skipIf", SKIPPED))
_WHILE: Final = "_while"
ASKED: Final = frozenset({*dict(_FORESTALLING), _WHILE})
"""The conditions whose value must be true or false."""
_ON_SUCCESS: Final = "_onSuccess"
_ON_FAILURE: Final = "_onFailure"
_POST: Final = "_post"
_ON_HALTED: Final = "_onHalted"

CONDITION_ATTRIBUTES: Final = frozenset(
    {*dict(_FORESTALLING), _WHILE, _ON_SUCCESS, _ON_FAILURE, _POST, _ON_HALTED}
)


def check_condition(text: str) -> str | None:
    """Return the error of a condition's script, or None."""
    try:
        parse_question(text)
    except ScriptError as error:
        return str(error)
    return None


class Conditions:
    """The conditions of one node.

    Args:
        given: scripts by attribute.

    Raises:
        ScriptError: one of them cannot be parsed.
    """

    def __init__(self, given: Mapping[str, str]) -> None:
        self.scripts: dict[str, Script] = {name: parse_script(text) for name, text in given.items()}
        self._forestalling = [
            (self.scripts[name], status) for name, status in _FORESTALLING if name in self.scripts
        ]
        self._while = self.scripts.get(_WHILE)
        self._ended = {
            SUCCESS: self._scripts(_ON_SUCCESS, _POST),
            FAILURE: self._scripts(_ON_FAILURE, _POST),
        }
        self._halted = self._scripts(_ON_HALTED)

    def _scripts(self, *names: str) -> list[Script]:
        return [self.scripts[name] for name in names if name in self.scripts]

    def forestall(self, standing: Status, environment: Environment) -> Status | None:
        """Return the status that replaces the node's tick, or None to tick the node.

        Args:
            standing: the node's status. A running node is only asked `_while`; when that answers
                SKIPPED, the caller halts the node.
            environment: the names of the scripts.

        Raises:
            ScriptError: a script fails.
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
        """Run what belongs to an end with SUCCESS or FAILURE.

        Args:
            status: how the node ended.
            environment: the names of the scripts.

        Raises:
            ScriptError: a script fails.
        """
        for script in self._ended[status]:
            script.run(environment)

    def halted(self, environment: Environment) -> None:
        """Run what belongs to a halt.

        Raises:
            ScriptError: a script fails.
        """
        for script in self._halted:
            script.run(environment)
