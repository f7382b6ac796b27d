"""ReturnToBase: search, approach, detour, and the last metre by the track."""

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.behaviours.fly.return_world import (
    SEARCH_GIMBAL,
    approaching,
    boxed,
    fly,
    marked,
    returning,
    searching,
    unseen,
)
from tests.behaviours.path.drawn_maps import where
from tests.worlds.leaves import ADVANCE, TURN_LEFT, TURN_RIGHT, velocity
from tests.worlds.values import motion
from uav_bt.answers import FollowLeg
from uav_bt.board import FLIGHT_HEIGHT, FLIGHT_PITCH, MARK, ODOMETRY, PHASE, SITE_MAP
from uav_bt.testing.world import Says, drawn_map
from uav_bt.tree import Status
from uav_bt.types import MoveBy, Velocity
from uav_bt.types.dead_reckoning import OdometryPose
from uav_bt.types.site_map import SiteMap


def test_it_searches_under_the_policy() -> None:
    """At the speed of a policy that has one: its leg may be metres long.

    Only a sight of the pad ends it, no place that is uncertain: the track may have gone astray.
    """
    bench = searching()
    for seconds in (0.3, 0.1):
        fly(bench, (2.0, 0.0), seconds=seconds, unseen_s=3.0, std_m=0.5)
        assert bench.proposed == MoveBy(id=1, forward_m=0.3)
    assert bench.pointed == SEARCH_GIMBAL
    assert bench.board[PHASE] == "search"
    bench = searching(FollowLeg(yaw_rad=0.1, speed_mps=0.4))
    fly(bench, seconds=0.3)
    assert velocity(bench).forward_mps == pytest.approx(0.4)
    assert velocity(bench).yaw_rate_radps > 0.0


# Search by the map.


@pytest.mark.parametrize(("moved_s", "std_m"), [(-math.inf, 0.6), (0.0, 0.03)])
def test_it_flies_to_the_mark_of_the_map(moved_s: float, std_m: float) -> None:
    """At a speed, above movers, without asking the policy, though the mark was not seen for long.

    A step under the policy is broken off for it. From nearer an uncertain place is corrected.
    """
    policy = Says(ADVANCE)
    bench = searching(policy)
    bench.board[FLIGHT_HEIGHT] = 1.5
    fly(bench, seconds=0.3)
    assert bench.proposed == MoveBy(id=1, forward_m=0.3)
    for _ in range(2):
        fly(bench, site_map=replace(marked(1.6, 0.2, std_m=std_m), moved_s=moved_s))
        assert velocity(bench).forward_mps > 0.25
        assert abs(velocity(bench).yaw_rate_radps) < 0.4
    assert (velocity(bench).down_mps < -0.2) == (moved_s == 0.0)
    assert bench.board[PHASE] == "approach"
    assert len(policy.views) <= 1


def test_a_mark_of_the_map_that_is_not_there_counts_again_once_it_is_seen() -> None:
    """Begun again above its place, the drone covers ground by the map."""
    bench, there = searching(TURN_LEFT), marked(0.1, 0.0)
    assert fly(bench, site_map=there) is Status.SUCCESS
    elsewhere = replace(marked(0.4, 0.0), passed=where("right"))
    for _ in range(3):
        fly(bench, site_map=elsewhere, seconds=0.3)
    assert bench.board[PHASE] == "search"
    assert velocity(bench).yaw_rate_radps < -0.3  # to the left, where it has not been
    fly(bench, site_map=marked(0.4, 0.0, seen_s=bench.clock.now()))
    assert bench.board[PHASE] == "approach"


def test_where_no_way_is_known_it_looks_around_and_then_makes_a_detour() -> None:
    wall = np.column_stack([np.full(41, 0.8), np.linspace(-2.0, 2.0, 41)])
    bench = searching(TURN_LEFT)
    shut = replace(marked(1.8, 0.0), obstacles_m=wall)
    for _ in range(26):
        fly(bench, (1.8, 0.0), site_map=shut, seconds=0.3)
        assert velocity(bench).yaw_rate_radps > 0.3
    for _ in range(4):
        fly(bench, (1.8, 0.0), site_map=shut, seconds=0.3)
    assert velocity(bench) == Velocity(yaw_rate_radps=-0.6)


def test_by_a_map_that_views_contradict_no_route_is_flown() -> None:
    """It flies straight while nothing that was seen is near that way."""
    wrong = replace(marked(1.8, 0.0), contradicted_s=9.0)
    bench = searching()
    fly(bench, (1.8, 0.0), site_map=wrong)
    assert velocity(bench).forward_mps > 0.0
    fly(bench, (1.8, 0.0), site_map=wrong, obstacles=[(1.0, 0.1)])
    assert bench.proposed is None


def test_at_the_edge_the_camera_is_lowered_where_the_map_leads_not_under_a_policy() -> None:
    """A student knows views of one pitch; lowered, a view shows it ground where the edge is."""
    for approach in ("policy", "memory"):
        bench, drawn = returning(approach=approach), drawn_map(pose=(0.0, 1.8, math.pi / 2))
        edge = replace(drawn, seen_s=np.where(where("left"), -math.inf, drawn.seen_s))
        here = OdometryPose(x_m=0.0, y_m=1.8, yaw_rad=math.pi / 2, time_s=0.0)
        bench.board[ODOMETRY] = motion(here, tracked_s=0.0)
        bench.allow_stale()
        for _ in range(2):
            fly(bench, site_map=edge, yaw_rad=math.pi / 2)
        assert (bench.pointed != SEARCH_GIMBAL) == (approach == "memory")


# Approach.


def test_flies_to_a_pad_ahead_and_slows_down() -> None:
    """Hardly turning, for as long as the board carries the pad: one number says how long.

    The camera keeps the pitch of the return, whatever the pitch of the flight.
    """
    far, near = approaching((3.0, 0.05)), approaching((0.5, 0.02))
    assert 0.2 < velocity(far).forward_mps <= 0.5
    assert 0.0 < velocity(near).forward_mps < velocity(far).forward_mps
    assert abs(velocity(far).yaw_rate_radps) < 0.1
    far.board[FLIGHT_PITCH] = math.radians(-42)
    fly(far, (2.4, 0.0), unseen_s=MARK.max_age_s - 0.2)
    assert velocity(far).forward_mps > 0.0
    assert far.pointed == SEARCH_GIMBAL


@pytest.mark.parametrize("pad", [(2.4, 0.0), None])
def test_a_pad_lost_for_long_is_searched_again(pad: tuple[float, float] | None) -> None:
    bench = approaching()
    bench.allow_stale()
    fly(bench, pad, unseen_s=21.0)
    assert bench.proposed is None
    assert bench.board[PHASE] == "search"
    fly(bench, seconds=0.3)
    assert isinstance(bench.proposed, MoveBy)


@pytest.mark.parametrize(
    ("pad", "site_map", "rate_radps"),
    [
        pytest.param((2.5, 0.0), boxed((1.0, 0.1)), -0.2, id="a box on the right"),
        pytest.param((2.5, 0.0), boxed((0.8, -0.2)), 0.2, id="a box on the left"),
        pytest.param((1.5, -1.5), marked(1.5, 1.0), 0.3, id="an error, far from the map's mark"),
    ],
)
def test_it_turns_to_the_free_side_of_a_box_and_to_the_mark_of_the_map(
    pad: tuple[float, float], site_map: SiteMap, rate_radps: float
) -> None:
    bench = approaching(pad, site_map=site_map)
    assert velocity(bench).yaw_rate_radps / rate_radps > 1.0


@pytest.mark.parametrize("apart_m", [0.55, 0.5])
def test_beside_the_pad_the_way_may_be_narrow(apart_m: float) -> None:
    """Boxes on three sides of it, and the ground below and behind it was never seen."""
    sides = [(1.5, -apart_m), (1.5, apart_m), (1.5 + apart_m, 0.0)]
    points = [(x_m + 0.02 * n, y_m + 0.02 * n) for x_m, y_m in sides for n in range(-2, 3)]
    around = boxed(*points, pad=(1.5, 0.0))
    around = unseen(around, np.hypot(*np.moveaxis(around.places_m(), -1, 0)) < 0.4)
    bench = searching()
    fly(bench, (1.5, 0.0), site_map=around)
    assert velocity(bench).forward_mps > 0.2
    assert abs(velocity(bench).yaw_rate_radps) < 0.1


def test_the_camera_follows_the_pad_down() -> None:
    """It shows the ground before the pad, but is not so steep that bases would be mistaken.

    It follows a mat further down than a box.
    """
    for range_m, height_m, pitch_deg in ((1.2, 0.4, -42.5), (0.5, 0.4, -50.0), (1.45, 0.05, -45.0)):
        bench = searching()
        fly(bench, (range_m, 0.0), height_m=height_m)
        assert bench.pointed is not None
        assert math.degrees(bench.pointed.pitch_rad) == pytest.approx(pitch_deg, abs=0.1)


WALL = [(0.8 * math.cos(a), 0.8 * math.sin(a)) for a in np.radians(range(-180, 180, 10))]


def test_a_detour_takes_two_steps_and_faces_the_pad_again() -> None:
    bench = approaching((2.5, 0.0), Says(TURN_RIGHT, ADVANCE))
    fly(bench, (2.5, 0.0), obstacles=WALL)
    fly(bench, (2.5, 0.0), obstacles=WALL, seconds=0.3)
    assert velocity(bench).yaw_rate_radps > 0.0
    for yaw_rad in (0.3, 0.6, 0.6):
        fly(bench, (2.5, -1.0), obstacles=WALL, yaw_rad=yaw_rad)
    for step in (1, 2):
        fly(bench, (2.0, -1.5), obstacles=WALL, seconds=0.3, yaw_rad=0.6)
        assert bench.proposed == MoveBy(id=step, forward_m=0.3)
        bench.clock.advance(0.4)
        bench.finish_movement()
        if step == 2:
            del bench.board[SITE_MAP]  # the wall
        bench.tick()  # the class map still shows the view before the step
        assert step == 2 or bench.proposed is None
    fly(bench, (1.8, -1.5), yaw_rad=0.6)
    assert bench.board[PHASE] == "approach"
    assert velocity(bench).yaw_rate_radps < 0.0
    assert velocity(bench).forward_mps == 0.0
