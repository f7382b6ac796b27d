"""Rays, ground points and projections: known values, round trips and refusals."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.worlds.tables import cases
from uav_bt.errors import ValueRangeError
from uav_bt.types import CameraModel
from uav_bt.types.projection import elevation_to_row, ground_points, ground_range_to_row, project

CASES = cases("values")

# Round numbers, unequal focal lengths as after a resize that changes the aspect.
CAMERA = CameraModel(width_px=201, height_px=101, fx_px=100.0, fy_px=80.0, cx_px=100.0, cy_px=50.0)
CENTRE = (100.0, 50.0)

pitches = st.floats(-math.pi / 2, 0.3)


# --- known values ---------------------------------------------------------------------------------


@pytest.mark.parametrize(("pixel", "pitch_deg", "expected"), CASES["ground_points"])
def test_ground_points_known_values(
    pixel: tuple[float, float], pitch_deg: float, expected: tuple[float, float]
) -> None:
    """Hand-computed points at a height of 2 m."""
    point = ground_points(pixel, CAMERA, math.radians(pitch_deg), 2.0)

    assert point == pytest.approx(expected, abs=1e-9)


def test_what_is_not_seen_has_no_place() -> None:
    """Pixels of the horizon and the sky give NaN, as points behind the camera or at depth 0."""
    points = ground_points([CENTRE, (100.0, 20.0), (100.0, 90.0)], CAMERA, 0.0, 1.0)
    assert np.isfinite(points).tolist() == [[False] * 2, [False] * 2, [True] * 2]
    pixels = project([(-1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (2.0, 0.0, 0.0)], CAMERA, 0.0)
    assert np.isnan(pixels[:2]).all()
    assert pixels[2] == pytest.approx(CENTRE)


# --- round trips ----------------------------------------------------------------------------------


@settings(deadline=None)
@given(
    pitches,
    st.floats(0.2, 3.0),
    st.floats(0.0, 200.0),
    st.floats(0.0, 100.0),
)
def test_pixel_to_ground_and_back(
    pitch_rad: float, height_m: float, column: float, row: float
) -> None:
    """The projection of a pixel's ground point is the pixel."""
    point = ground_points((column, row), CAMERA, pitch_rad, height_m)
    if np.isnan(point).any() or np.abs(point).max() > 1e4:
        return  # near the horizon ground points are inaccurate
    back = project((*point, height_m), CAMERA, pitch_rad)

    assert back == pytest.approx((column, row), abs=1e-5)


@settings(deadline=None)
@given(st.floats(-math.pi / 2, 0.0), st.floats(0.3, 8.0), st.floats(0.3, 3.0))
def test_row_of_a_range_sees_that_range(pitch_rad: float, range_m: float, height_m: float) -> None:
    """`ground_range_to_row` undoes `ground_points` in the central column."""
    row = ground_range_to_row(range_m, CAMERA, pitch_rad, height_m)
    point = ground_points((CAMERA.cx_px, row), CAMERA, pitch_rad, height_m)

    assert point == pytest.approx((range_m, 0.0), rel=1e-4, abs=1e-6)


@pytest.mark.parametrize(("pitch_deg", "side"), [(30, 1), (-90, -1)])
def test_elevation_behind_the_image_plane_is_far_outside(pitch_deg: float, side: int) -> None:
    """Straight down from a raised camera is far below the image, above the horizon far above it."""
    elevation_rad = -side * math.pi / 2 if side > 0 else 0.3

    row = elevation_to_row(elevation_rad, CAMERA, math.radians(pitch_deg))

    assert side * row > 1e6
    assert round(row) != 0  # finite, because callers round it


# --- refusals -------------------------------------------------------------------------------------


@pytest.mark.parametrize("height_m", [0.0, -0.4, math.nan])
def test_the_camera_must_be_above_the_plane(height_m: float) -> None:
    """A camera below the plane is refused; its points would be mirrored."""
    with pytest.raises(ValueRangeError, match="above the plane"):
        ground_points(CENTRE, CAMERA, -0.5, height_m)
