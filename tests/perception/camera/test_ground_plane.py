"""The ground plane in the image: known values, the lever of the lens, roll, and the twin's word."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from perception.camera.ground_plane import (
    CameraView,
    ground_depth,
    level_rays,
    ray_lengths,
    view_of,
)
from sim_bridge.anafi import anafi_camera
from sim_bridge.twin.scene_file import load_scene
from sim_bridge.twin.views import render_views, sample_flight_poses
from tests.paper_lab import CARPET
from tests.worlds import values
from uav_bt.errors import ValueRangeError
from uav_bt.types import Attitude, CameraModel
from uav_bt.types.projection import pixel_rays, project

CAMERA = CameraModel(
    width_px=41, height_px=21, fx_px=20.0, fy_px=16.0, cx_px=20.0, cy_px=10.0, forward_offset_m=0.2
)


def view(pitch_deg: float = -30.0, height_m: float = 1.5, roll_deg: float = 0.0) -> CameraView:
    return CameraView(
        camera=CAMERA,
        pitch_rad=math.radians(pitch_deg),
        height_m=height_m,
        roll_rad=math.radians(roll_deg),
    )


def test_the_axis_meets_the_ground_where_trigonometry_says() -> None:
    depth = ground_depth(view(pitch_deg=-30.0, height_m=1.5))

    assert depth[10, 20] == pytest.approx(3.0)
    assert depth.dtype == np.float32
    assert depth.shape == (21, 41)


def test_straight_down_depth_is_the_height_everywhere_and_range_is_not() -> None:
    """Depth is along the optical axis; only the range grows towards the corners."""
    looking_down = view(pitch_deg=-90.0, height_m=1.2)
    depth = ground_depth(looking_down)

    assert depth == pytest.approx(np.full((21, 41), 1.2), rel=1e-6)
    range_m = depth * ray_lengths(CAMERA)
    assert range_m[10, 20] == pytest.approx(1.2)
    assert range_m[10, 40] == pytest.approx(1.2 * math.sqrt(2.0))


def test_above_the_horizon_there_is_no_ground() -> None:
    depth = ground_depth(view(pitch_deg=0.0))

    assert np.isnan(depth[:11]).all()
    assert np.isfinite(depth[11:]).all()


def test_a_raised_plane_is_nearer() -> None:
    assert ground_depth(view(), plane_m=0.4)[15, 7] == pytest.approx(
        ground_depth(view())[15, 7] * 1.1 / 1.5
    )


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


def test_a_roll_to_the_right_brings_the_ground_nearer_on_the_right() -> None:
    depth = ground_depth(view(roll_deg=10.0))

    assert depth[10, 20] == pytest.approx(3.0)
    assert depth[10, 30] < 2.9
    assert depth[10, 10] > 3.1


def test_the_lens_rises_with_the_nose_and_the_gimbal_holds_its_pitch() -> None:
    """Of the body's attitude only the lever of the lens ahead of its centre matters."""
    frame = values.frame((4, 8), attitude=Attitude(pitch_rad=0.1, roll_rad=0.3, yaw_rad=1.0))
    seen = view_of(frame, CAMERA, (82, 42))

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


def test_a_thousand_ground_points_agree_with_the_twin() -> None:
    """The ground rendered by the twin lies within 1 mm of the ground plane."""
    generator = np.random.default_rng(11)
    poses = sample_flight_poses(load_scene("val-a"), generator, 14)
    camera = anafi_camera(640, 360).resized(224, 112)
    checked, worst_m = 0, 0.0
    views = render_views(load_scene("val-a"), poses, size_px=(160, 90), truth_size_px=(224, 112))
    for drawn in views:
        seen = CameraView(camera=camera, pitch_rad=drawn.pose.pitch_rad, height_m=drawn.pose.z_m)
        places = np.flatnonzero(drawn.ids == CARPET)
        if places.size < 100:
            continue
        rows, columns = np.divmod(generator.choice(places, 100, replace=False), 224)
        error_m = ground_depth(seen)[rows, columns] - drawn.depth[rows, columns]
        range_error_m = error_m * ray_lengths(camera)[rows, columns]
        checked, worst_m = checked + len(rows), max(worst_m, float(np.abs(range_error_m).max()))
    assert checked >= 1000
    assert worst_m < 1e-3
