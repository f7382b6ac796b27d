"""Scores of adapted networks."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.rooms.adapted import Outcome, ground_iou
from benchmarks.rooms.score import RoomScore


def test_iou_counts_what_is_ground_or_called_ground() -> None:
    """60 right, 20 missed, 40 too many: 60 of 120."""
    confusion = np.array([[500, 30, 0], [15, 60, 5], [0, 10, 80]])
    score = RoomScore(confusion=confusion, scales=np.zeros(0), milliseconds=1.0)
    assert ground_iou(score) == pytest.approx(0.5)


def test_a_row_has_both_scores() -> None:
    outcome = Outcome(room="room-0001", before=0.9, after=0.95, note="new head", computed_s=12.4)
    assert outcome.row() == "| room-0001 | 0.900 | 0.950 | new head | 12 |"
