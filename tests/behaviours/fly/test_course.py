"""A course between answers, and a turn under way."""

from __future__ import annotations

import math

import pytest

from behaviours.fly.course import Course
from behaviours.fly.held_rotation import HeldRotation
from uav_bt.answers import FollowLeg, Rotate

AHEAD = FollowLeg(yaw_rad=0.2, speed_mps=0.4)


def test_a_course_is_flown_on_without_an_answer_for_half_a_second() -> None:
    course = Course()
    assert course.follow(AHEAD, yaw_rad=0.0, now_s=1.0) is not None
    speed_mps, yaw_rate = course.follow(None, yaw_rad=0.1, now_s=1.4) or (0.0, 0.0)
    assert speed_mps == pytest.approx(0.4)
    assert yaw_rate > 0.0  # to the same heading, 0.1 rad further
    assert course.follow(None, yaw_rad=0.1, now_s=1.6) is None


def test_without_an_answer_there_is_no_course() -> None:
    assert Course().follow(None, yaw_rad=0.0, now_s=1.0) is None


def test_a_rotation_is_a_course_without_speed() -> None:
    speed_mps, yaw_rate = Course().follow(Rotate(yaw_rad=-0.5), yaw_rad=0.0, now_s=1.0) or (1, 1)
    assert speed_mps == 0.0
    assert yaw_rate < 0.0


def test_a_course_that_was_dropped_is_not_flown_on() -> None:
    course = Course()
    course.follow(AHEAD, yaw_rad=0.0, now_s=1.0)
    course.drop()
    assert course.follow(None, yaw_rad=0.0, now_s=1.1) is None


@pytest.mark.parametrize("direction", [1, -1])
def test_a_turn_is_complete_after_its_angle_whichever_way_and_across_north(direction: int) -> None:
    turn, yaw_rad = HeldRotation(), direction * (math.pi - 0.1)
    assert turn.complete
    turn.begin(0.3, yaw_rad=yaw_rad)
    assert turn.under_way
    assert turn.go_on(yaw_rad + direction * 0.2, direction) == pytest.approx(direction * 0.2)
    assert not turn.complete
    turn.go_on(math.remainder(yaw_rad + direction * 0.31, 2 * math.pi), direction)
    assert turn.complete
