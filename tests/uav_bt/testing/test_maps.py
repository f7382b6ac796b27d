"""Drawn maps: ground, walls, and refused arguments."""

from __future__ import annotations

import numpy as np
import pytest

from uav_bt.errors import ShapeError, ValueRangeError
from uav_bt.testing import drawn_map


def test_walls_have_points_from_end_to_end() -> None:
    points = drawn_map(
        walls=[((1.0, -0.5), (1.0, 0.5)), ((0.0, 1.0), (0.0, 1.0))], obstacles=np.array([[-1, 0]])
    ).obstacles_m
    assert points[0] == pytest.approx((-1.0, 0.0))
    wall = points[points[:, 0] == 1.0]
    assert (wall[0, 1], wall[-1, 1]) == pytest.approx((-0.5, 0.5))
    assert np.diff(wall[:, 1]).max() <= 0.05 + 1e-9
    assert (points[-2:] == (0.0, 1.0)).all()


def test_what_does_not_fit_is_refused() -> None:
    with pytest.raises(ShapeError, match="known"):
        drawn_map(known=np.ones((3, 3), dtype=bool))
    with pytest.raises(ShapeError, match="obstacles"):
        drawn_map(obstacles=np.zeros(2))
    with pytest.raises(ValueRangeError, match="ground_m must be positive"):
        drawn_map(ground_m=0.0)
