"""Telemetry of the frames of a video."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from tests.worlds.footage import frame, state, write_record
from uav_bt.app.perceive.telemetry import Telemetry
from uav_bt.errors import FileError
from uav_bt.record.reader import RecordReader
from uav_bt.types import CameraModel

CAMERA = CameraModel(width_px=32, height_px=24, fx_px=25.0, fy_px=20.0, cx_px=15.5, cy_px=11.5)
IMAGE = np.zeros((24, 32, 3), np.uint8)


@pytest.fixture
def flown(tmp_path: Path) -> Telemetry:
    """Three frames from 10 s on, during a climb and a turn across yaw = pi."""
    frames = [
        frame(
            IMAGE,
            place,
            10.0 + place,
            gimbal_pitch_rad=-0.5 - 0.1 * place,
            height_above_ground_m=1.4 + place,
            yaw_rad=yaw_rad,
        )
        for place, yaw_rad in enumerate((3.0, -3.2, -3.1))
    ]
    states = [state(*one) for one in ((9.8, 0.1), (10.1, 0.2), (10.9, 0.3), (11.5, 0.4))]
    path = write_record(tmp_path / "flight.mcap", CAMERA, frames, states)
    return Telemetry.of_flight(RecordReader(path))


def test_a_fixed_camera_has_the_same_pose_in_every_frame_and_no_states() -> None:
    fixed = Telemetry.fixed(1.2, -0.6)
    frame = fixed.frame(IMAGE, 7, 3.5)
    assert (frame.index, frame.captured_s) == (7, 3.5)
    assert (frame.height_above_ground_m, frame.gimbal_pitch_rad) == (1.2, -0.6)
    assert fixed.states(10.0) == []


def test_a_flights_telemetry_begins_with_its_video_and_is_interpolated(flown: Telemetry) -> None:
    assert flown.times_s == pytest.approx([0.0, 1.0, 2.0])
    heights_m = [
        flown.frame(IMAGE, 0, time_s).height_above_ground_m for time_s in (-0.5, 0.0, 0.5, 2.5)
    ]
    assert heights_m == pytest.approx([math.nan, 1.4, 1.9, math.nan], nan_ok=True)
    between = flown.frame(IMAGE, 0, 0.5)
    assert between.gimbal_pitch_rad == pytest.approx(-0.55)
    # From 3.0 to -3.2 the short way across pi is 0.08 rad, the long way 6.2 rad.
    assert math.cos(between.attitude.yaw_rad) < -0.99


def test_states_come_once_and_up_to_the_time_asked_for(flown: Telemetry) -> None:
    assert [state.captured_s for state in flown.states(0.1)] == pytest.approx([-0.2, 0.1])
    assert flown.states(0.1) == []
    assert [state.velocity.forward_mps for state in flown.states(5.0)] == [0.3, 0.4]


def test_a_record_without_a_frame_is_refused(tmp_path: Path) -> None:
    path = write_record(tmp_path / "flight.mcap", CAMERA, [], [state(0.0)])
    with pytest.raises(FileError, match="no frame with an image"):
        Telemetry.of_flight(RecordReader(path))
