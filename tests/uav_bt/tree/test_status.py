"""The five statuses and their names elsewhere."""

from __future__ import annotations

import pytest
from py_trees import common

from uav_bt.tree import Status


@pytest.mark.parametrize(
    ("status", "number", "letter", "name_there"),
    [
        (Status.IDLE, 0, "I", "INVALID"),
        (Status.RUNNING, 1, "R", "RUNNING"),
        (Status.SUCCESS, 2, "S", "SUCCESS"),
        (Status.FAILURE, 3, "F", "FAILURE"),
        (Status.SKIPPED, 4, "K", "INVALID"),
    ],
)
def test_five_statuses(status: Status, number: int, letter: str, name_there: str) -> None:
    """The engine's numbers, a letter each, and the py_trees status that stands for it."""
    assert (status.value, status.letter) == (number, letter)
    assert status.py_trees is common.Status[name_there]


def test_skipped_is_not_idle() -> None:
    """Five members, all different."""
    assert Status.SKIPPED is not Status.IDLE
    assert len(Status) == 5
