"""The five statuses, and their names in other programs."""

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
    """Each status has the engine's number, a letter, and a py_trees status."""
    assert (status.value, status.letter) == (number, letter)
    assert status.py_trees is common.Status[name_there]


def test_skipped_is_not_idle() -> None:
    """Five members, all different."""
    assert Status.SKIPPED is not Status.IDLE
    assert len(Status) == 5
