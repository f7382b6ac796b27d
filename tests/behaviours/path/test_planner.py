"""The way round remembered obstacles."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from behaviours.path.planner import PathConfig, first_segment
from uav_bt.types import ObstaclePoints

CONFIG = PathConfig()
NOTHING = np.empty((0, 2))


def segment(
    bases: NDArray[np.float64] = NOTHING,
    goal: tuple[float, float] = (2.0, 0.0),
    *,
    edges: NDArray[np.float64] = NOTHING,
    assumed: NDArray[np.float64] = NOTHING,
    yaw_rad: float = 0.0,
    present_rad: float | None = None,
) -> float | None:
    known = ObstaclePoints(points_m=bases, edges_m=edges, assumed_m=assumed, captured_s=0.0)
    return first_segment(known, goal, CONFIG, yaw_rad=yaw_rad, present_rad=present_rad)


def wall(forward_m: float, left_m: float, right_m: float) -> NDArray[np.float64]:
    across = np.arange(left_m, right_m + 0.01, 0.05)
    return np.column_stack([np.full(len(across), forward_m), across])


@pytest.mark.parametrize("bearing_deg", [-170, -90, -30, 0, 45, 120])
def test_without_obstacles_the_way_is_straight(bearing_deg: float) -> None:
    goal = (2.0 * math.cos(math.radians(bearing_deg)), 2.0 * math.sin(math.radians(bearing_deg)))

    bearing = segment(goal=goal)

    assert bearing is not None
    off = math.remainder(bearing - math.radians(bearing_deg), 2.0 * math.pi)
    assert abs(off) < math.radians(3)


def test_it_goes_round_the_nearer_end_of_a_wall() -> None:
    right = segment(wall(1.0, -1.0, 0.2), (2.5, 0.0))
    left = segment(wall(1.0, -0.2, 1.0), (2.5, 0.0))

    assert right is not None
    assert left is not None
    assert right > math.radians(20)
    assert left < -math.radians(20)


def test_a_gap_that_is_too_narrow_is_no_way() -> None:
    """Through 0.4 m it would touch; round the end it does not."""
    gap = np.vstack([wall(1.0, -2.0, -0.2), wall(1.0, 0.2, 0.6)])

    bearing = segment(gap)

    assert bearing is not None
    assert bearing > math.radians(20)


def test_a_gap_that_is_wide_enough_is_taken() -> None:
    gap = np.vstack([wall(1.0, -2.0, -0.45), wall(1.0, 0.45, 2.0)])

    bearing = segment(gap)

    assert bearing == pytest.approx(0.0, abs=math.radians(10))


def test_a_goal_that_is_walled_in_has_no_way() -> None:
    around = np.linspace(0.0, 2.0 * math.pi, 80)
    ring = np.column_stack([2.0 + 0.7 * np.cos(around), 0.7 * np.sin(around)])

    assert segment(ring) is None


def test_what_stands_too_near_the_drone_does_not_lock_it_in() -> None:
    bearing = segment(wall(-0.2, -0.3, 0.3))

    assert bearing == pytest.approx(0.0, abs=math.radians(10))


def test_a_tight_gap_is_flown_where_there_is_no_other_way() -> None:
    """It is wider than the body; the ways round it are closed."""
    gap = np.vstack([wall(1.0, -2.5, -0.3), wall(1.0, 0.3, 2.5)])

    assert segment(gap) == pytest.approx(0.0, abs=math.radians(15))


def test_where_an_obstacle_is_only_assumed_it_goes_round_if_it_can() -> None:
    """But it does not give up where it cannot."""
    assumed = wall(1.0, -0.4, 0.2)
    everywhere = wall(1.0, -3.0, 3.0)

    round_it = segment(assumed=assumed)

    assert round_it is not None
    assert round_it > math.radians(10)
    assert segment(assumed=everywhere) is not None


def test_no_way_leads_off_the_carpet() -> None:
    """Round the right end it would be shorter, but the carpet ends there."""
    obstacle, edge = wall(1.0, -1.2, 0.2), wall(0.0, 0.0, 2.0)[:, ::-1] + (0.0, 0.45)

    round_it = segment(obstacle, edges=edge)

    assert round_it is not None
    assert round_it < -math.radians(30)


@pytest.mark.parametrize("yaw_deg", [0, 30, 90, 200])
def test_the_way_stays_where_it_is_while_the_drone_turns(yaw_deg: float) -> None:
    """The same place, seen from another heading."""
    yaw_rad = math.radians(yaw_deg)
    c, s = math.cos(yaw_rad), math.sin(yaw_rad)
    bases, goal = wall(1.0, -1.0, 0.2), np.array([2.5, 0.0])
    to_body = np.array([[c, -s], [s, c]])

    forward_m, right_m = goal @ to_body
    turned = segment(bases @ to_body, (float(forward_m), float(right_m)), yaw_rad=yaw_rad)
    straight = segment(bases, (2.5, 0.0))

    assert turned is not None
    assert straight is not None
    assert math.remainder(turned + yaw_rad - straight, 2.0 * math.pi) == pytest.approx(
        0.0, abs=1e-6
    )


def test_the_side_being_flown_is_kept_until_the_other_is_clearly_better() -> None:
    """Both ends are about as far."""
    even, uneven = wall(1.0, -0.55, 0.45), wall(1.0, -1.6, 0.2)

    kept = segment(even, (2.5, 0.0), present_rad=-0.7)
    given_up = segment(uneven, (2.5, 0.0), present_rad=-0.9)

    assert kept is not None
    assert given_up is not None
    assert kept < 0.0 < given_up
