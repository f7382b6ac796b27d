"""The history of poses, and odometry: the integral of velocity and yaw."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from tests.uav_bt.types.circle_flight import TICK_S, Flight, state
from tests.worlds.tables import cases
from uav_bt.types import DroneState, MeasurementTimes, Pose
from uav_bt.types.dead_reckoning import Odometry, PoseHistory

CASES = cases("values")


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


# --- quantities with different times --------------------------------------------------------------


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
