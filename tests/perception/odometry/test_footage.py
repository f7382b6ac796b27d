"""Footage in memory: arrays that do not fit each other are refused."""

from dataclasses import replace

import numpy as np
import pytest

from perception.odometry.footage import Footage, shrink
from uav_bt.errors import ShapeError, ValueRangeError
from uav_bt.types import CameraModel

CAMERA = CameraModel(
    width_px=32, height_px=24, fx_px=25.0, fy_px=20.0, cx_px=15.5, cy_px=11.5, distortion=(0.1, 0.0)
)


def _footage(count: int = 3) -> Footage:
    rng = np.random.default_rng(0)
    line = np.linspace(0.0, 1.0, count)
    return Footage(
        frames=rng.integers(0, 255, (count, 24, 32, 3), dtype=np.uint8),
        index=np.arange(count, dtype=np.int64),
        captured_s=line,
        gimbal_pitch_rad=-line,
        attitude_rad=rng.random((count, 3)),
        altitude_m=line,
        height_m=line,
        height_above_carpet_m=line,
        state_s=np.arange(5.0),
        state_attitude_rad=rng.random((5, 3)),
        velocity_mps=rng.random((5, 3)),
        camera=CAMERA,
    )


def test_arrays_of_another_length_are_refused() -> None:
    with pytest.raises(ShapeError, match="footage velocity_mps must be 5x3, got 4x3"):
        replace(_footage(), velocity_mps=np.zeros((4, 3)))


def test_frames_of_another_size_than_the_cameras_are_refused() -> None:
    with pytest.raises(ShapeError, match="footage frames must be 3x24x32x3, got 3x24x30x3"):
        replace(_footage(), frames=np.zeros((3, 24, 30, 3), np.uint8))


def test_times_that_do_not_rise_are_refused() -> None:
    with pytest.raises(ValueRangeError, match="captured_s must rise"):
        replace(_footage(), captured_s=np.array([0.0, 0.2, 0.2]))


def test_numbers_that_are_none_are_refused() -> None:
    with pytest.raises(ValueRangeError, match="altitude_m holds NaN"):
        replace(_footage(), altitude_m=np.array([0.0, np.nan, 1.0]))


def test_an_image_is_resized_and_never_cropped() -> None:
    picture = np.zeros((360, 640, 3), np.uint8)
    picture[:, 320:] = 200
    small = shrink(picture)
    assert small.shape == (256, 320, 3)
    assert (small[:, :160] == 0).all()
    assert (small[:, 160:] == 200).all()
