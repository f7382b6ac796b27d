"""Where the pictures of a video were taken from."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.footage.file import Footage
from perception.footage.telemetry import FixedTelemetry, FootageTelemetry
from uav_bt.errors import ValueRangeError
from uav_bt.types import CameraModel

CAMERA = CameraModel(width_px=32, height_px=24, fx_px=25.0, fy_px=20.0, cx_px=15.5, cy_px=11.5)
IMAGE = np.zeros((24, 32, 3), np.uint8)


def footage() -> Footage:
    """Three frames from second 10 on, climbing and turning through the back."""
    line = np.array([0.0, 1.0, 2.0])
    yaw = np.array([3.0, -3.2, -3.1])
    return Footage(
        frames=np.zeros((3, 24, 32, 3), np.uint8),
        index=np.arange(3, dtype=np.int64),
        captured_s=10.0 + line,
        gimbal_pitch_rad=-0.5 - 0.1 * line,
        attitude_rad=np.stack([0.0 * line, 0.02 * line, yaw], axis=1),
        altitude_m=1.0 + line,
        height_m=1.0 + line,
        height_above_carpet_m=1.4 + line,
        state_s=np.array([9.8, 10.1, 10.9, 11.5]),
        state_attitude_rad=np.zeros((4, 3)),
        velocity_mps=np.array([[0.1, 0, 0], [0.2, 0, 0], [0.3, 0, 0], [0.4, 0, 0]]),
        camera=CAMERA,
    )


def test_a_fixed_camera_has_the_same_pose_in_every_picture_and_no_states() -> None:
    fixed = FixedTelemetry(height_m=1.2, gimbal_pitch_rad=-0.6)
    frame = fixed.frame(IMAGE, 7, 3.5)
    assert (frame.index, frame.captured_s) == (7, 3.5)
    assert (frame.height_above_carpet_m, frame.gimbal_pitch_rad) == (1.2, -0.6)
    assert fixed.states(10.0) == []


@pytest.mark.parametrize("pose", [(0.0, -0.5), (math.nan, -0.5), (1.5, -2.0), (1.5, math.nan)])
def test_a_pose_that_cannot_be_is_refused(pose: tuple[float, float]) -> None:
    with pytest.raises(ValueRangeError):
        FixedTelemetry(height_m=pose[0], gimbal_pitch_rad=pose[1])


def test_a_flights_telemetry_begins_with_its_video() -> None:
    flown = FootageTelemetry(footage())
    assert flown.times_s == pytest.approx([0.0, 1.0, 2.0])
    assert flown.frame(IMAGE, 0, 0.0).height_above_carpet_m == pytest.approx(1.4)


def test_between_two_entries_telemetry_is_interpolated() -> None:
    frame = FootageTelemetry(footage()).frame(IMAGE, 0, 0.5)
    assert frame.gimbal_pitch_rad == pytest.approx(-0.55)
    assert frame.height_above_carpet_m == pytest.approx(1.9)
    assert frame.attitude.pitch_rad == pytest.approx(0.01)
    # From 3.0 to -3.2 is 0.08 rad through the back, not 6.2 rad through the front.
    assert math.cos(frame.attitude.yaw_rad) < -0.99


@pytest.mark.parametrize("time_s", [-0.5, 2.5])
def test_beyond_the_flights_ends_nobody_knows_the_height(time_s: float) -> None:
    frame = FootageTelemetry(footage()).frame(IMAGE, 0, time_s)
    assert math.isnan(frame.height_above_carpet_m)


def test_states_come_once_and_up_to_the_time_asked_for() -> None:
    flown = FootageTelemetry(footage())
    assert [state.captured_s for state in flown.states(0.1)] == pytest.approx([-0.2, 0.1])
    assert flown.states(0.1) == []
    later = flown.states(5.0)
    assert [state.velocity.forward_mps for state in later] == [0.3, 0.4]
