"""The metadata of frames."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sim_bridge.olympe.metadata import FrameMetadata, frame_metadata


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
