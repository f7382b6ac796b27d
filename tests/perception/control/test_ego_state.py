"""The control student's inputs besides the pixels."""

import math
from typing import Any

import numpy as np
import pytest

from perception.control.ego_state import mirrored, state_size, state_vector
from uav_bt.types.dead_reckoning import OdometryPose

NOW = OdometryPose(time_s=10.0, x_m=2.0, y_m=1.0, yaw_rad=math.pi / 2)  # it looks along y
THEN = OdometryPose(time_s=9.5, x_m=1.9, y_m=0.7, yaw_rad=math.pi / 2 - 0.2)


def told(*poses: OdometryPose, **changed: float) -> np.ndarray:
    values: Any = {"height_above_ground_m": 1.7, "gimbal_pitch_rad": math.radians(-20)}
    return state_vector(poses, **{**values, "turning": -1, "full_turns": 2, **changed})


def test_the_usual_stand_is_nought() -> None:
    usual = {"height_above_ground_m": 1.5, "gimbal_pitch_rad": math.radians(-30)}
    assert told(NOW, NOW, **usual, turning=0, full_turns=0) == pytest.approx([0.0] * 9, abs=1e-6)


def test_the_state_vector_has_differences_from_the_usual() -> None:
    numbers = told(NOW)
    assert numbers == pytest.approx([0.2, math.radians(10), -1.0, 2 / 3], abs=1e-6)
    assert numbers.dtype == np.float32
    assert told(NOW, full_turns=9)[3] == 1.0  # the rules relieve three turns at most
    for views in (1, 2, 3):
        assert told(*[NOW] * views).shape == (state_size(views),)


def test_an_earlier_view_is_relative_to_the_body_now() -> None:
    """It came from 0.3 m behind and 0.1 m to the right, and has turned clockwise since."""
    assert told(NOW, THEN)[4:] == pytest.approx(
        [0.5, -0.3, 0.1, math.sin(-0.2), 1 - math.cos(0.2)], abs=1e-6
    )


def test_a_mirror_exchanges_left_and_right_and_nothing_else() -> None:
    numbers = told(NOW, THEN)
    turned = mirrored(np.stack([numbers, numbers]))[1]
    assert turned == pytest.approx(numbers * [1, 1, -1, 1, 1, 1, -1, -1, 1])
    assert mirrored(turned) == pytest.approx(numbers)
