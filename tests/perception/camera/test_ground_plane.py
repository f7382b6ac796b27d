"""The ground plane in the image: known values, the lever of the lens and roll."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from perception.camera import ground_plane
from perception.camera.ground_plane import CameraView, ground_depth, level_rays, ray_lengths
from tests.worlds import values
from uav_bt.errors import ValueRangeError
from uav_bt.testing import pinhole
from uav_bt.types import Attitude
from uav_bt.types.projection import pixel_rays, project

CAMERA = replace(pinhole(41, 21), fx_px=20.0, fy_px=16.0, forward_offset_m=0.2)


def view(pitch_deg: float = -30.0, height_m: float = 1.5, roll_deg: float = 0.0) -> CameraView:
    pitch_rad, roll_rad = math.radians(pitch_deg), math.radians(roll_deg)
    return CameraView(camera=CAMERA, pitch_rad=pitch_rad, height_m=height_m, roll_rad=roll_rad)


def test_the_ground_is_where_trigonometry_says() -> None:
    depth = ground_depth(view(pitch_deg=-30.0, height_m=1.5))
    assert depth[10, 20] == pytest.approx(3.0)
    assert (depth.dtype, depth.shape) == (np.float32, (21, 41))
    raised = ground_depth(view(), plane_m=0.4)
    assert raised[15, 7] == pytest.approx(depth[15, 7] * 1.1 / 1.5)
    level = ground_depth(view(pitch_deg=0.0))
    assert np.isnan(level[:11]).all()
    assert np.isfinite(level[11:]).all()
    rolled = ground_depth(view(roll_deg=10.0))  # to the right, where the ground is nearer
    assert rolled[10, 20] == pytest.approx(3.0)
    assert rolled[10, 30] < 2.9
    assert rolled[10, 10] > 3.1
    # Straight down, depth along the optical axis is the height everywhere; the range is not.
    down = ground_depth(view(pitch_deg=-90.0, height_m=1.2))
    assert down == pytest.approx(np.full((21, 41), 1.2), rel=1e-6)
    range_m = down * ray_lengths(CAMERA)
    assert range_m[10, [20, 40]] == pytest.approx([1.2, 1.2 * math.sqrt(2.0)])


@settings(deadline=None, max_examples=30)
@given(st.floats(-1.5, 0.4), st.floats(-0.4, 0.4))
def test_rays_of_the_grid_are_those_of_the_pixels(pitch_rad: float, roll_rad: float) -> None:
    grid = CameraView(camera=CAMERA, pitch_rad=pitch_rad, height_m=1.0, roll_rad=roll_rad)
    columns, rows = np.meshgrid(np.arange(41), np.arange(21))
    pixels = np.stack([columns, rows], axis=-1)
    expected = pixel_rays(pixels, CAMERA, pitch_rad, roll_rad)
    assert np.moveaxis(level_rays(grid), 0, -1) == pytest.approx(expected, abs=1e-5)
    there = project(expected, CAMERA, pitch_rad, roll_rad)
    assert there == pytest.approx(pixels.astype(float), abs=1e-6)


def test_the_lens_rises_with_the_nose_and_the_gimbal_holds_its_pitch() -> None:
    """Of the body's attitude only the lever of the lens ahead of its centre matters."""
    frame = values.frame((4, 8), attitude=Attitude(pitch_rad=0.1, roll_rad=0.3, yaw_rad=1.0))
    seen = ground_plane.view_of(frame, CAMERA, (82, 42))
    assert seen.height_m == pytest.approx(1.5 + 0.2 * math.sin(0.1))
    assert seen.pitch_rad == -0.5
    assert seen.camera == CAMERA.resized(82, 42)


def test_impossible_views_are_refused() -> None:
    for height_m in (0.0, -1.0):
        with pytest.raises(ValueRangeError, match="above the plane"):
            ground_depth(view(height_m=height_m))
    for pitch_rad, height_m in ((0.0, math.nan), (math.inf, 1.0), (1.7, 1.0)):
        with pytest.raises(ValueRangeError, match="finite height"):
            CameraView(camera=CAMERA, pitch_rad=pitch_rad, height_m=height_m)
