"""The history of poses, and odometry: velocity and yaw added up."""

from __future__ import annotations

import math

import pytest

from tests.uav_bt.types.circle_flight import TICK_S, Flight, state
from uav_bt.types import DroneState, Pose
from uav_bt.types.dead_reckoning import Odometry, PoseHistory


def pose(x_m: float = 0.0, yaw_rad: float = 0.0) -> Pose:
    return Pose(x_m=x_m, y_m=0.0, z_m=1.5, yaw_rad=yaw_rad)


@pytest.mark.parametrize("rate", [0.0, 0.7, -1.4])
def test_odometry_follows_a_circle(rate: float) -> None:
    """Eight seconds on a circle at the mission's tick are followed to within 2 cm."""
    flight, odometry = Flight(0.5, rate), Odometry()

    for tick in range(81):
        odometry.update(flight.state(TICK_S * tick))

    found, truth = odometry.now, flight.pose(8.0)
    assert found is not None
    assert math.dist((found.x_m, found.y_m), (truth.x_m, truth.y_m)) < 0.02


def test_odometry_follows_sideways_motion() -> None:
    """Velocity to the right counts to the right of the heading."""
    odometry = Odometry()
    for tick in range(11):
        odometry.update(state(TICK_S * tick, math.pi, right_mps=0.3))

    assert odometry.now is not None
    assert (odometry.now.x_m, odometry.now.y_m) == pytest.approx((0.0, -0.3))


def test_odometry_counts_half_of_a_change_of_speed() -> None:
    """Between two samples the speed is their mean."""
    odometry = Odometry()
    odometry.update(state(0.0))
    pose = odometry.update(state(0.2, forward_mps=1.0))

    assert pose.x_m == pytest.approx(0.1)


@pytest.mark.parametrize(
    "bad",
    [
        state(1.0, forward_mps=9.0),
        state(0.5, forward_mps=9.0),
        state(1.1, forward_mps=math.nan),
        state(1.1, yaw_rad=math.nan),
        state(1.1, right_mps=math.inf),
    ],
)
def test_odometry_passes_over_useless_samples(bad: DroneState) -> None:
    """A sample that is old, or has no numbers, changes nothing."""
    odometry = Odometry()
    odometry.update(state(1.0))

    odometry.update(bad)
    pose = odometry.update(state(1.2))

    assert (pose.x_m, pose.y_m, pose.yaw_rad) == (0.0, 0.0, 0.0)


def test_odometry_may_begin_with_a_useless_sample() -> None:
    """Nothing is remembered of it."""
    odometry = Odometry()

    odometry.update(state(0.0, yaw_rad=math.nan))

    assert odometry.now is None


def test_odometry_interpolates_across_the_wrap() -> None:
    """Half-way between 175 and -175 degrees lies 180, not 0."""
    odometry = Odometry()
    odometry.update(state(0.0, math.radians(175)))
    odometry.update(state(0.1, math.radians(-175)))

    pose = odometry.at(0.05)

    assert pose is not None
    assert math.cos(pose.yaw_rad) == pytest.approx(-1.0)


def test_odometry_beyond_its_memory() -> None:
    """Before the first sample there is nothing; earlier than its memory, the oldest; later, now."""
    odometry = Odometry(memory_s=1.0)
    assert odometry.at(0.0) is None
    for tick in range(31):
        odometry.update(state(TICK_S * tick, forward_mps=1.0))

    oldest, newest = odometry.at(0.0), odometry.at(9.0)

    assert oldest is not None
    assert newest is not None
    assert oldest.time_s == pytest.approx(2.0)
    assert newest == odometry.now


def test_a_pose_of_the_past_lies_between_its_neighbours_and_turns_the_short_way() -> None:
    history = PoseHistory[Pose](2.0)
    history.add(1.0, pose(x_m=0.0, yaw_rad=math.pi - 0.1))
    history.add(2.0, pose(x_m=2.0, yaw_rad=-math.pi + 0.1))
    between = history.at(1.5)
    assert between is not None
    assert between.x_m == pytest.approx(1.0)
    assert abs(math.remainder(between.yaw_rad - math.pi, 2 * math.pi)) < 1e-9


def test_poses_before_and_after_all_notes_are_the_outermost() -> None:
    history = PoseHistory[Pose](2.0)
    assert history.at(1.0) is None
    history.add(1.0, pose(x_m=1.0))
    history.add(2.0, pose(x_m=2.0))
    assert (history.at(0.0), history.at(9.0)) == (pose(x_m=1.0), pose(x_m=2.0))


def test_old_poses_are_forgotten() -> None:
    history = PoseHistory[Pose](2.0)
    for tick in range(1000):
        history.add(0.1 * tick, pose(x_m=float(tick)))
    oldest = history.at(0.0)
    assert oldest is not None
    assert oldest.x_m > 950
