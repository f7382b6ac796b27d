"""What a node answers, in py_trees' own words.

BehaviorTree.CPP has five statuses, py_trees four. Nothing is missing: the engine never *keeps*
SKIPPED on a node (a skipped node stands idle, only its parent hears of the skip) and a tick never
*answers* idle. So py_trees' `INVALID` is both: as a standing status it means idle, as the answer of
a tick it means skipped. The names `IDLE` and `SKIPPED` say which one is meant.
"""

from __future__ import annotations

from typing import Final

from py_trees.common import Status

__all__ = ["FAILURE", "IDLE", "RUNNING", "SKIPPED", "SUCCESS", "Status"]

SUCCESS: Final = Status.SUCCESS
FAILURE: Final = Status.FAILURE
RUNNING: Final = Status.RUNNING
IDLE: Final = Status.INVALID  # a standing status: nothing is going on
SKIPPED: Final = Status.INVALID  # an answer: pass me over
