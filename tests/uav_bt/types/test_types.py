"""Values with checks and geometry."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.paper_lab import paper_map
from tests.worlds.tables import cases
from uav_bt.errors import ShapeError, ValueRangeError
from uav_bt.testing.world import drawn_map
from uav_bt.types import (
    Airframe,
    CameraModel,
    DepthMap,
    DroneState,
    FlyingState,
    Frame,
    GimbalTo,
    HeldTurn,
    MarkFix,
    MeasurementTimes,
    MoveBy,
    NearObstacles,
    Velocity,
    clamp,
    limit_length,
)
from uav_bt.types.site_map import MapObject

CASES = cases("values")

CAMERA = CameraModel(
    width_px=640, height_px=360, fx_px=466.0, fy_px=466.0, cx_px=319.5, cy_px=179.5
)

KINDS: dict[str, Any] = {kind.__name__: kind for kind in (Airframe, GimbalTo, MoveBy, Velocity)}


def obstacles(*points_m: tuple[float, float], **more: NDArray[np.float64]) -> NearObstacles:
    points = np.array(points_m, dtype=np.float64).reshape(-1, 2)
    return NearObstacles(points_m=points, captured_s=0.0, **more)


@pytest.mark.parametrize(("value", "bounded"), [(2.0, 1.5), (-2.0, -1.5), (0.3, 0.3)])
def test_numbers_and_vectors_are_bounded(value: float, bounded: float) -> None:
    assert clamp(value, 1.5) == bounded
    assert limit_length(3.0, -4.0, 1.0) == pytest.approx((0.6, -0.8))
    assert limit_length(0.3, -0.4, 1.0) == (0.3, -0.4)
    assert limit_length(0.0, 0.0, 0.0) == limit_length(3.0, 4.0, 0.0) == (0.0, 0.0)


# --- the camera -----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["width_px", "height_px", "fx_px", "fy_px"])
def test_a_camera_has_a_size_and_focal_lengths(name: str) -> None:
    zero: dict[str, Any] = {name: 0}
    with pytest.raises(ValueRangeError, match="must be positive"):
        dataclasses.replace(CAMERA, **zero)


# --- arrays ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("shape", [(4, 6), (4, 6, 4), (1, 4, 6, 3)])
def test_a_frame_is_refused_unless_it_has_three_channels(shape: tuple[int, ...]) -> None:
    with pytest.raises(ShapeError, match="frame image must be HxWx3, got "):
        Frame(image=np.zeros(shape, dtype=np.uint8), index=0, captured_s=0.0, gimbal_pitch_rad=0.0)


def test_class_and_depth_maps_are_flat() -> None:
    with pytest.raises(ShapeError, match="class map must be HxW, got 2x2x1"):
        paper_map(ids=np.zeros((2, 2, 1), dtype=np.uint8), captured_s=0.0)
    with pytest.raises(ShapeError, match="depth map must be HxW, got 4"):
        DepthMap(depth=np.zeros(4, dtype=np.float32), metric=True, captured_s=0.0)


@pytest.mark.parametrize("shape", [(3,), (2, 3), (0, 3)])
def test_obstacle_points_come_in_pairs(shape: tuple[int, ...]) -> None:
    for name in ("points_m", "assumed_m", "edges_m"):
        wrong: dict[str, Any] = {name: np.zeros(shape)}
        with pytest.raises(ShapeError, match="obstacle points must be Nx2"):
            NearObstacles(captured_s=0.0, **wrong)


# --- commands -------------------------------------------------------------------------------------


@pytest.mark.parametrize(("kind", "given", "words"), CASES["refused_numbers"])
def test_impossible_numbers_are_refused(kind: str, given: dict[str, Any], words: str) -> None:
    GimbalTo(pitch_rad=math.radians(-90))
    with pytest.raises(ValueRangeError, match=words):
        KINDS[kind](**given)


# --- results of perception ------------------------------------------------------------------------


def test_a_mark_has_range_and_bearing_clockwise_from_the_heading() -> None:
    right_behind = MarkFix(captured_s=0.0, forward_m=-3.0, right_m=4.0, height_m=0.4, detected=True)
    assert right_behind.range_m == 5.0
    assert math.degrees(right_behind.bearing_rad) == pytest.approx(126.87, abs=0.01)


@pytest.mark.parametrize(("turned_deg", "turns"), [(0, 0), (359, 0), (361, 1), (725, 2)])
def test_full_turns_are_counted_when_they_are_complete(turned_deg: float, turns: int) -> None:
    assert HeldTurn(direction=1, turned_rad=math.radians(turned_deg)).full_turns == turns


@pytest.mark.parametrize(("point_m", "free"), CASES["ways"])
def test_a_way_keeps_half_a_metre_from_a_point(point_m: tuple[float, float], *, free: bool) -> None:
    """In any direction, and for assumed points unless they are not to count."""
    assert obstacles(point_m).allows(2.0, margin_m=0.5) is free
    aside = obstacles((5.0, 5.0), (-point_m[1], point_m[0]), (-3.0, 0.0))
    assert aside.allows(0.0, 2.0, margin_m=0.5) is free
    assumed = obstacles(assumed_m=np.array([point_m]))
    assert assumed.allows(2.0, margin_m=0.5) is free
    assert assumed.allows(2.0, margin_m=0.5, assumed=False)


def test_what_is_too_near_already_may_be_left_and_passed_but_not_approached() -> None:
    near = obstacles((0.0, 0.3))
    assert near.allows(1.0, margin_m=0.5)  # abeam: passed
    assert near.allows(0.0, -1.0, margin_m=0.5)  # behind
    assert not near.allows(0.0, 0.2, margin_m=0.5)
    assert not obstacles((0.2, 0.3)).allows(1.0, margin_m=0.5)  # nearer on the way


def test_bearings_of_unknown_range_are_counted_on_both_sides() -> None:
    seen = obstacles(unplaced_rad=np.radians([-40.0, -9.0, 0.0, 9.0, 11.0]))
    assert seen.unplaced_within(math.radians(10)) == 3
    assert obstacles().unplaced_within(math.pi) == 0


# --- telemetry ------------------------------------------------------------------------------------

APART = MeasurementTimes(attitude_s=5.0, velocity_s=4.8, altitude_s=4.9, height_s=3.0, gimbal_s=5.1)


def test_a_state_is_as_old_as_the_oldest_of_attitude_velocity_and_altitude() -> None:
    """A quantity without a time makes the state undated."""
    state = DroneState(captured_s=4.8, flying=FlyingState.FLYING, measured=APART)
    assert (state.times, APART.oldest_s) == (APART, 4.8)
    times = dataclasses.replace(APART, altitude_s=math.nan)
    assert math.isnan(dataclasses.replace(state, captured_s=math.nan, measured=times).captured_s)


def test_a_state_that_contradicts_its_parts_is_refused() -> None:
    with pytest.raises(ValueRangeError, match=r"altitude, 4.8 s, got 5.0 s; `dated` changes"):
        DroneState(captured_s=5.0, flying=FlyingState.FLYING, measured=APART)


def test_a_state_dated_anew_keeps_its_parts_apart() -> None:
    state = DroneState(captured_s=4.8, flying=FlyingState.FLYING, measured=APART).dated(10.0)
    assert state.captured_s == 10.0
    assert dataclasses.astuple(state.times) == pytest.approx((10.2, 10.0, 10.1, 8.2, 10.3))


# --- the site map ---------------------------------------------------------------------------------


def test_an_outline_has_points_on_all_sides_at_most_a_step_apart() -> None:
    box = MapObject(class_id=1, x_m=1.0, y_m=0.0, size_m=0.4, width_m=0.2, std_m=0.0, seen_s=0.0)
    expected = [
        *((1.2, 0.1), (1.0, 0.1)),  # from corner to corner, two steps a side
        *((0.8, 0.1), (0.8, 0.0)),
        *((0.8, -0.1), (1.0, -0.1)),
        *((1.2, -0.1), (1.2, 0.0)),
    ]
    np.testing.assert_allclose(box.outline_m(0.2), expected, atol=1e-12)


def test_the_middle_of_a_cell_lies_in_it() -> None:
    site_map = drawn_map()  # its corner is at (-3, -3), its cells are 0.1 m wide
    middles_m = site_map.middles_m(np.array([[0, 0], [30, 41]]))
    np.testing.assert_allclose(middles_m, [[-3.0, -3.0], [0.0, 1.1]], atol=1e-12)
    assert site_map.cell_of(*map(float, middles_m[1])) == (30, 41)
    assert site_map.places_m()[30, 41] == pytest.approx(middles_m[1])


def test_a_map_is_shown_by_the_shapes_of_its_arrays() -> None:
    assert "obstacles_m=<0x2 float64>" in repr(drawn_map())
