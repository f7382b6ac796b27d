"""Poses and rotations in a level plane."""

from __future__ import annotations

import math

import numpy as np
import pytest

from uav_bt.types import Pose2D


def test_heading_east_ahead_is_y() -> None:
    """Yaw is clockwise and y to the right: at a quarter turn, ahead is +y and right is -x."""
    pose = Pose2D(x_m=1.0, y_m=2.0, yaw_rad=math.pi / 2)

    assert pose.to_world(3.0, 0.0) == pytest.approx((1.0, 5.0))
    assert pose.to_world(0.0, 3.0) == pytest.approx((-2.0, 2.0))


def test_points_go_to_the_world_and_back_as_single_ones_do() -> None:
    """Arrays give the same results as numbers."""
    here = Pose2D(x_m=1.0, y_m=2.0, yaw_rad=0.7)
    points = np.array([[1.0, 0.5], [-2.0, 3.0]])
    there = here.points_to_world(points)
    assert there == pytest.approx(np.array([here.to_world(*point) for point in points.tolist()]))
    assert here.points_to_body(there) == pytest.approx(points)
