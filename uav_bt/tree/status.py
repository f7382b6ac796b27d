"""The five statuses of BehaviorTree.CPP 4, and the py_trees status for each.

A node's stored status is IDLE, RUNNING, SUCCESS or FAILURE. Its tick returns RUNNING, SUCCESS,
FAILURE or SKIPPED. The parent passes over a skipped node, whose stored status does not change.
"""

from __future__ import annotations

import enum
from typing import Final

from py_trees import common


class Status(enum.Enum):
    """The status of a node; the values are the engine's numbers, which Groot2 and logs use."""

    IDLE = 0
    RUNNING = 1
    SUCCESS = 2
    FAILURE = 3
    SKIPPED = 4

    @property
    def letter(self) -> str:
        """The letter in scripts and short reports: R, S, F, K for SKIPPED, I for IDLE."""
        return "K" if self is Status.SKIPPED else self.name[0]

    @property
    def py_trees(self) -> common.Status:
        """The py_trees status; INVALID for both IDLE and SKIPPED."""
        return common.Status.__members__.get(self.name, common.Status.INVALID)


# Module-level names for the engine: reading an attribute of an enumeration costs a call.
IDLE: Final = Status.IDLE
RUNNING: Final = Status.RUNNING
SUCCESS: Final = Status.SUCCESS
FAILURE: Final = Status.FAILURE
SKIPPED: Final = Status.SKIPPED

ANSWER_NAMES: Final = ("SUCCESS", "FAILURE", "SKIPPED", "RUNNING")
"""Names of a node's answer in ports of tree files."""
