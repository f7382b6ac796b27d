"""Poses, projections of the camera, and odometry."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.uav_bt.types.circle_flight import TICK_S, Flight, state
from tests.worlds.tables import cases
from uav_bt.errors import ValueRangeError
from uav_bt.types import CameraModel, DroneState, MeasurementTimes, Pose, Pose2D
from uav_bt.types.dead_reckoning import Odometry, PoseHistory
from uav_bt.types.projection import elevation_to_row, ground_points, ground_range_to_row, project


def test_heading_east_ahead_is_y() -> None:
    """Yaw is clockwise and y to the right: at a quarter turn, ahead is +y and right is -x."""
    pose = Pose2D(x_m=1.0, y_m=2.0, yaw_rad=math.pi / 2)
    assert pose.to_world(3.0, 0.0) == pytest.approx((1.0, 5.0))
    assert pose.to_world(0.0, 3.0) == pytest.approx((-2.0, 2.0))


def test_points_go_to_the_world_and_back_as_single_ones_do() -> None:
    """Arrays give the same results as numbers."""
    here = Pose2D(x_m=1.0, y_m=2.0, yaw_rad=0.7)
    points = np.array([[1.0, 0.5], [-2.0, 3.0]])
    there = here.points_to_world(points)
    assert there == pytest.approx(np.array([here.to_world(*point) for point in points.tolist()]))
    assert here.points_to_body(there) == pytest.approx(points)


# --- projections ----------------------------------------------------------------------------------

CASES = cases("values")

# Round numbers, unequal focal lengths as after a resize that changes the aspect.
CAMERA = CameraModel(width_px=201, height_px=101, fx_px=100.0, fy_px=80.0, cx_px=100.0, cy_px=50.0)
CENTRE = (100.0, 50.0)

pitches = st.floats(-math.pi / 2, 0.3)


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


@pytest.mark.parametrize("height_m", [0.0, -0.4, math.nan])
def test_the_camera_must_be_above_the_plane(height_m: float) -> None:
    """A camera below the plane is refused; its points would be mirrored."""
    with pytest.raises(ValueRangeError, match="above the plane"):
        ground_points(CENTRE, CAMERA, -0.5, height_m)


# --- odometry: the integral of velocity and yaw ---------------------------------------------------


def pose(x_m: float = 0.0, yaw_rad: float = 0.0) -> Pose:
    return Pose(x_m=x_m, y_m=0.0, z_m=1.5, yaw_rad=yaw_rad)


@pytest.mark.parametrize(("reports", "now_s", "x_m"), CASES["integrals"])
def test_velocities_are_integrated_between_their_times(
    reports: list[tuple[float, float]], now_s: float, x_m: float
) -> None:
    odometry, sideways = Odometry(), Odometry()
    for time_s, speed_mps in reports:
        pose = odometry.update(state(time_s, forward_mps=speed_mps), now_s=now_s)
        aside = sideways.update(state(time_s, math.pi, right_mps=speed_mps), now_s=now_s)
    assert (pose.x_m, pose.y_m) == pytest.approx((x_m, 0.0))
    assert (aside.x_m, aside.y_m) == pytest.approx((0.0, -x_m))


@pytest.mark.parametrize(
    "bad",
    [
        *(state(1.0, forward_mps=9.0), state(0.5, forward_mps=9.0)),
        *(state(1.1, forward_mps=math.nan), state(1.1, right_mps=math.inf)),
        state(1.1, yaw_rad=math.nan),
    ],
)
def test_odometry_passes_over_useless_samples(bad: DroneState) -> None:
    """An old sample, or one with NaN, changes nothing, also at the beginning."""
    odometry = Odometry()
    odometry.update(state(1.1, yaw_rad=math.nan))
    assert odometry.now is None
    odometry.update(state(1.0))
    odometry.update(bad)
    pose = odometry.update(state(1.2))
    assert (pose.x_m, pose.y_m, pose.yaw_rad) == (0.0, 0.0, 0.0)


def reported(
    velocity_s: float, attitude_s: float, *, forward_mps: float = 0.0, yaw_rad: float = 0.0
) -> DroneState:
    """Telemetry whose velocity and attitude were measured at different times."""
    times = replace(
        MeasurementTimes.all_at(velocity_s), attitude_s=attitude_s, altitude_s=attitude_s
    )
    report = state(0.0, yaw_rad, forward_mps)
    return replace(report, captured_s=times.oldest_s, measured=times)


def test_a_pose_has_the_heading_of_its_own_time() -> None:
    """Attitude is of 0.2 s, velocity of 0.1 s: at 0.1 s half of the turn is done."""
    odometry = Odometry()
    odometry.update(reported(0.0, 0.0))
    odometry.update(reported(0.1, 0.2, yaw_rad=0.2))
    at = odometry.at(0.1)
    assert at is not None
    assert at.yaw_rad == pytest.approx(0.1)
    assert odometry.now is not None
    assert (odometry.now.time_s, odometry.now.yaw_rad) == pytest.approx((0.2, 0.2))


def test_the_heading_of_a_frame_places_it_exactly() -> None:
    """Reported headings are 0.2 s apart; the drone turned suddenly between two of them."""
    odometry = Odometry()
    odometry.update(state(0.0))
    odometry.update(state(0.2, yaw_rad=0.2))
    odometry.add_heading(0.1, 0.19)
    at = odometry.at(0.1)
    assert at is not None
    assert at.yaw_rad == pytest.approx(0.19)


@pytest.mark.parametrize("rate", [1e-6, 0.7, -1.4])
def test_five_late_reports_a_second_follow_a_circle(rate: float) -> None:
    """With samples 0.1 to 0.2 s old, at 0.5 m/s, the present pose is known to 3 cm."""
    flight, odometry = Flight(0.5, rate), Odometry()
    for tick in range(81):
        measured_s = 0.2 * ((tick - 1) // 2)
        pose = odometry.update(flight.state(max(0.0, measured_s)), now_s=TICK_S * tick)
        truth = flight.pose(TICK_S * tick)
        if tick > 5:
            assert math.dist((pose.x_m, pose.y_m), (truth.x_m, truth.y_m)) < 0.03
            assert abs(math.remainder(pose.yaw_rad - truth.yaw_rad, 2 * math.pi)) < 1e-6


def test_a_pose_of_the_past_lies_between_its_neighbours_and_turns_the_short_way() -> None:
    history = PoseHistory[Pose](2.0)
    assert history.at(1.0) is None
    history.add(1.0, pose(x_m=0.0, yaw_rad=math.pi - 0.1))
    history.add(2.0, pose(x_m=2.0, yaw_rad=-math.pi + 0.1))
    between = history.at(1.5)
    assert between is not None
    assert between.x_m == pytest.approx(1.0)
    assert [at.x_m for at in (history.at(0.0), history.at(9.0)) if at is not None] == [0.0, 2.0]
    assert abs(math.remainder(between.yaw_rad - math.pi, 2 * math.pi)) < 1e-9
