"""Labels that agree between frames, and the place where the ground ends."""

from __future__ import annotations

import numpy as np
import pytest

from perception.segmentation.geometry.ground_limit import LimitConfig, Sighting, consistent
from perception.segmentation.geometry.labels import GROUND, NOT_GROUND, UNKNOWN
from uav_bt.errors import ShapeError

# A column of pixels that look ahead: near ground at the bottom, the far end at the top.
ROWS, COLUMNS = 40, 9
PLAIN = LimitConfig(border_px=0, filled_gap_px=0)


def _points() -> np.ndarray:
    ranges = np.linspace(9.0, 1.0, ROWS)[:, None]
    angles = np.linspace(-0.2, 0.2, COLUMNS)[None, :]
    return np.stack([ranges * np.cos(angles), ranges * np.sin(angles)], axis=2)


def _frame(**rows: tuple[slice, int]) -> Sighting:
    labels = np.full((ROWS, COLUMNS), UNKNOWN, np.uint8)
    for where, label in rows.values():
        labels[where] = label
    return Sighting(labels=labels, points_m=_points())


def _made(frames: list[Sighting], config: LimitConfig = PLAIN) -> list[np.ndarray]:
    return [labels for labels, _ in consistent(frames, np.zeros(2), config)]


def test_ground_that_one_frame_alone_saw_is_dropped() -> None:
    seen, blind = _frame(near=(slice(30, 40), GROUND)), _frame()
    assert (_made([seen, blind])[0] != GROUND).all()
    assert (_made([seen] * 3)[0][32:38] == GROUND).all()


def test_beyond_the_last_ground_all_is_hidden_by_the_wall() -> None:
    """Some rows of the wall have no texture; they are beyond the ground all the same."""
    frames = [_frame(near=(slice(25, 40), GROUND), wall=(slice(10, 14), NOT_GROUND))] * 4
    labels = _made(frames)[0]
    assert (labels[:20] == NOT_GROUND).all()
    assert (labels[30:38] == GROUND).all()


def test_without_a_surface_beyond_it_the_end_of_the_ground_stays_unknown() -> None:
    labels = _made([_frame(near=(slice(25, 40), GROUND))] * 4)[0]
    assert (labels[:20] == UNKNOWN).all()


def test_a_surface_in_front_of_ground_that_others_saw_is_doubted() -> None:
    ground = [_frame(near=(slice(20, 40), GROUND))] * 5
    labels = _made([*ground, _frame(odd=(slice(28, 32), NOT_GROUND))])[-1]
    assert (labels[28:32] != NOT_GROUND).all()


def test_rays_above_the_horizon_keep_their_label_and_are_sure() -> None:
    points = _points()
    points[:5] = np.nan
    labels = np.full((ROWS, COLUMNS), UNKNOWN, np.uint8)
    labels[:5] = NOT_GROUND
    made, confidence = consistent([Sighting(labels, points)], np.zeros(2))[0]
    assert (made[:5] == NOT_GROUND).all()
    assert (confidence[:5] == 1.0).all()
    assert (confidence[5:] == 0.0).all()


def test_the_border_of_the_ground_is_left_unknown() -> None:
    frames = [_frame(near=(slice(20, 40), GROUND))] * 4
    wide = _made(frames, LimitConfig(border_px=2, filled_gap_px=0))[0]
    assert np.count_nonzero(wide == GROUND) < np.count_nonzero(_made(frames)[0] == GROUND)


def test_no_frame_is_refused() -> None:
    with pytest.raises(ShapeError, match="sightings of ground"):
        consistent([], np.zeros(2))
