"""The newest frame, its metadata, and the frame clock."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sim_bridge.olympe.video import (
    CaptureTimes,
    DecodedFrame,
    FrameClock,
    FrameMetadata,
    NewestFrame,
    frame_metadata,
)
from tests.sim_bridge.olympe.fake_olympe import Time
from uav_bt.types import DroneState, FlyingState


def turned(roll: float, pitch: float, yaw: float) -> dict[str, float]:
    cr, sr, cp, sp = (f(a / 2) for a in (roll, pitch) for f in (math.cos, math.sin))
    cy, sy = math.cos(yaw / 2), math.sin(yaw / 2)
    return {
        "w": cr * cp * cy + sr * sp * sy,
        "x": sr * cp * cy - cr * sp * sy,
        "y": cr * sp * cy + sr * cp * sy,
        "z": cr * cp * sy - sr * sp * cy,
    }


@settings(deadline=None)  # the machine may be busy
@given(roll=st.floats(-3, 3), pitch=st.floats(-1.5, 1.5), yaw=st.floats(-3, 3))
def test_a_rotation_comes_back_as_angles(roll: float, pitch: float, yaw: float) -> None:
    attitude = frame_metadata({"drone": {"quat": turned(roll, pitch, yaw)}}).attitude
    assert attitude is not None
    found = (attitude.roll_rad, attitude.pitch_rad, attitude.yaw_rad)
    assert found == pytest.approx((roll, pitch, yaw), abs=1e-5)


def test_older_firmware_tells_a_flat_record() -> None:
    found = frame_metadata(
        {
            "drone_quat": turned(0.0, 0.0, 0.4),
            "frame_quat": turned(0.0, -0.6, 0.4),
            "ground_distance": 1.25,
        }
    )
    assert found.attitude is not None
    assert found.attitude.yaw_rad == pytest.approx(0.4)
    assert found.gimbal_pitch_rad == pytest.approx(-0.6)
    assert (found.height_m, found.altitude_m, found.captured_us) == (1.25, None, None)


@pytest.mark.parametrize(
    "found",
    [
        {},
        {"drone": 3, "camera": "x"},
        {"drone": {"quat": {"w": 0, "x": 0, "y": 0, "z": 0}, "ground_distance": None}},
        {"camera": {"quat": {"w": "a"}, "timestamp": 0}},
    ],
)
def test_metadata_without_content_are_no_error(found: dict[str, object]) -> None:
    assert frame_metadata(found) == FrameMetadata()


def clock(time: Time) -> FrameClock:
    return FrameClock(monotonic=time, condition=time)  # type: ignore[arg-type]


def test_a_tick_waits_for_its_time_even_when_a_frame_is_there() -> None:
    time = Time()
    ticking = clock(time)
    ticking.frame_arrived()
    ticking.sleep_until(0.03)
    assert ticking.now() == pytest.approx(0.03)


def test_without_frames_the_mission_still_ticks() -> None:
    ticking = clock(Time())
    ticking.sleep_until(0.03)
    assert ticking.now() == pytest.approx(0.13, abs=1e-5)


def test_a_frame_that_was_looked_at_wakes_no_waiter() -> None:
    ticking = clock(Time())
    ticking.frame_arrived()
    ticking.frame_seen()
    ticking.sleep_until(0.0)
    assert ticking.now() == pytest.approx(0.1, abs=1e-5)


def test_colours_come_back() -> None:
    """Red, green and blue fields, computed by the equations of BT.709."""
    wanted = np.array([[255, 0, 0], [0, 255, 0], [0, 0, 255]], np.float64)
    matrix = np.array([[0.2126, 0.7152, 0.0722], [-0.1146, -0.3854, 0.5], [0.5, -0.4542, -0.0458]])
    y, cb, cr = (matrix @ wanted.T) * np.array([[219], [224], [224]]) / 255
    planes = np.zeros((3 * 32 // 2, 96), np.uint8)
    for field in range(3):
        planes[:32, 32 * field : 32 * field + 32] = round(16 + y[field])
    for number, colour in enumerate((cb, cr)):
        half = np.repeat(np.round(128 + colour).astype(np.uint8)[None], 16, 0).repeat(16, 1)
        planes[32 + 8 * number : 40 + 8 * number] = half.reshape(8, 96)
    time = Time()
    frames = NewestFrame((96, 32), time, latency_s=0.0, arrived=lambda: None)
    frames.take(DecodedFrame(planes=planes))
    frame = frames.newest(DroneState(captured_s=0.0, flying=FlyingState.LANDED), 0.0)
    assert frame is not None
    seen = frame.image[16, [16, 48, 80]].astype(int)
    assert np.abs(seen - wanted).max() <= 6


def test_a_delayed_frame_keeps_its_time() -> None:
    times = CaptureTimes(0.1)
    assert times.captured(10.0, ("camera", 1_000_000)) == pytest.approx(9.9)
    assert times.captured(10.3, ("camera", 1_100_000)) == pytest.approx(10.0, abs=1e-3)
    assert times.captured(10.31, ("camera", 1_300_000)) == pytest.approx(10.2, abs=1e-3)


def test_clocks_are_not_mixed_up() -> None:
    times = CaptureTimes(0.1)
    assert times.captured(10.0, ("stream", 5_000_000_000)) == pytest.approx(9.9)
    assert times.captured(10.1, ("camera", 1_000_000)) == pytest.approx(10.0)
    assert times.captured(10.2, ("stream", 5_000_200_000)) == pytest.approx(10.1, abs=1e-3)


def test_a_clock_that_was_set_back_is_a_new_one() -> None:
    times = CaptureTimes(0.1)
    times.captured(10.0, ("camera", 900_000_000))
    assert times.captured(10.1, ("camera", 5_000)) == pytest.approx(10.0)


def test_a_frame_without_a_stamp_is_of_least_latency() -> None:
    assert CaptureTimes(0.1).captured(10.0, None) == pytest.approx(9.9)
