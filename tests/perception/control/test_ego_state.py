"""The control student's inputs besides the pixels."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.control.ego_state import EgoState, mirrored, state_size, state_vector
from uav_bt.types.dead_reckoning import OdometryPose

NOW = OdometryPose(time_s=10.0, x_m=2.0, y_m=1.0, yaw_rad=math.pi / 2)  # it looks along y
EGO = EgoState(
    height_above_ground_m=1.7, gimbal_pitch_rad=math.radians(-20), turning=-1, full_turns=2
)


def test_the_usual_stand_is_nought() -> None:
    usual = EgoState(height_above_ground_m=1.5, gimbal_pitch_rad=math.radians(-30))
    assert state_vector(usual, [NOW, NOW]) == pytest.approx([0.0] * 9, abs=1e-6)


def test_the_state_vector_has_differences_from_the_usual() -> None:
    numbers = state_vector(EGO, [NOW])
    assert numbers == pytest.approx([0.2, math.radians(10), -1.0, 2 / 3], abs=1e-6)
    assert numbers.dtype == np.float32


def test_an_earlier_view_is_relative_to_the_body_now() -> None:
    """It came from 0.3 m behind and 0.1 m to the right, and has turned clockwise since."""
    then = OdometryPose(time_s=9.5, x_m=1.9, y_m=0.7, yaw_rad=math.pi / 2 - 0.2)
    told = state_vector(EGO, [NOW, then])[4:]
    assert told == pytest.approx([0.5, -0.3, 0.1, math.sin(-0.2), 1 - math.cos(0.2)], abs=1e-6)


def test_more_full_turns_than_the_rules_relieve_say_no_more() -> None:
    many = EgoState(height_above_ground_m=1.5, gimbal_pitch_rad=-0.5, full_turns=9)
    assert state_vector(many, [NOW])[3] == 1.0


@pytest.mark.parametrize("views", [1, 2, 3])
def test_the_size_is_known_beforehand(views: int) -> None:
    assert state_vector(EGO, [NOW] * views).shape == (state_size(views),)


def test_a_mirror_exchanges_left_and_right_and_nothing_else() -> None:
    then = OdometryPose(time_s=9.5, x_m=1.9, y_m=0.7, yaw_rad=math.pi / 2 - 0.2)
    numbers = state_vector(EGO, [NOW, then])
    turned = mirrored(np.stack([numbers, numbers]))[1]
    assert turned == pytest.approx(numbers * [1, 1, -1, 1, 1, 1, -1, -1, 1])
    assert mirrored(turned) == pytest.approx(numbers)
