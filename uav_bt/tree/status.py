"""The five statuses of BehaviorTree.CPP 4, and which of py_trees' four stands for each.

A node *stands* IDLE, RUNNING, SUCCESS or FAILURE. Its tick *answers* RUNNING, SUCCESS, FAILURE or
SKIPPED: a skipped node is passed over by its parent and goes on standing as it stood.
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
        """What py_trees calls it; INVALID is both IDLE and SKIPPED."""
        return _PY_TREES[self.value]


_PY_TREES: Final = (
    common.Status.INVALID,
    common.Status.RUNNING,
    common.Status.SUCCESS,
    common.Status.FAILURE,
    common.Status.INVALID,
)

# Plain names for the engine: an enumeration's attribute costs a call.
IDLE: Final = Status.IDLE
RUNNING: Final = Status.RUNNING
SUCCESS: Final = Status.SUCCESS
FAILURE: Final = Status.FAILURE
SKIPPED: Final = Status.SKIPPED

ANSWER_NAMES: Final = ("SUCCESS", "FAILURE", "SKIPPED", "RUNNING")
"""What ports of tree files name as a node's answer."""
