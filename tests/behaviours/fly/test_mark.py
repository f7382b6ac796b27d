"""ReturnToBase: search, approach, detour, and the last metre by the track."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from behaviours.path.margins import Margins
from behaviours.path.nearby import RecentObstacles
from behaviours.path.passages import ClearanceMaps
from tests.behaviours.path.test_passages import MARK as MARK_M
from tests.behaviours.path.test_passages import corner
from tests.behaviours.path.test_survey import where
from tests.worlds.leaves import (
    ADVANCE,
    RETURN_TO_BASE,
    TURN_LEFT,
    TURN_RIGHT,
    map_with,
    steering_bench,
    velocity,
)
from tests.worlds.values import fix, motion
from uav_bt.answers import Advance, Answer, Blocked, Done, FollowLeg
from uav_bt.board import FLIGHT_HEIGHT, FLIGHT_PITCH, MARK, ODOMETRY, PHASE, SITE_MAP
from uav_bt.errors import InputError
from uav_bt.testing import LeafBench
from uav_bt.testing.world import Says, drawn_map, show
from uav_bt.tree import Status
from uav_bt.types import Clearances, GimbalTo, MoveBy, NearObstacles, Velocity
from uav_bt.types.dead_reckoning import OdometryPose
from uav_bt.types.site_map import MapMark, SiteMap

SEARCH_GIMBAL = GimbalTo(pitch_rad=math.radians(-30))


def fly(
    bench: LeafBench,
    pad: tuple[float, float] | None = None,
    *,
    seconds: float = 0.1,
    unseen_s: float = 0.0,
    std_m: float = 0.0,
    height_m: float = 0.4,
    site_map: SiteMap | None = None,
    obstacles: Sequence[tuple[float, float]] = (),
    yaw_rad: float = 0.0,
) -> Status:
    """Tick with the pad ahead and right, seen some time ago; None: never seen."""
    show(bench, seconds=seconds, yaw_rad=yaw_rad)
    now_s = bench.clock.now()
    del bench.board[MARK]
    if pad is not None:
        seen = {"detected": unseen_s == 0.0, "std_m": std_m, "height_m": height_m}
        bench.board[MARK] = fix(now_s - unseen_s, *pad, **seen)
    points_m = np.array(obstacles, dtype=np.float64).reshape(-1, 2)
    near = NearObstacles(points_m=points_m, captured_s=now_s)
    if site_map is None and obstacles:
        site_map = map_with(near)
    del bench.board[SITE_MAP]
    if site_map is not None:
        bench.board[SITE_MAP] = replace(site_map, captured_s=now_s, near=near)
    return bench.tick()


def returning(answer: Answer | Says = ADVANCE, **attributes: object) -> LeafBench:
    policy = answer if isinstance(answer, Says) else Says(answer)
    bench = steering_bench(RETURN_TO_BASE, policy, gimbal_deg=-30.0, **attributes)
    bench.board[FLIGHT_PITCH] = math.radians(-30)
    return bench


def searching(answer: Answer | Says = ADVANCE) -> LeafBench:
    bench = returning(answer)
    assert fly(bench) is Status.RUNNING
    assert bench.proposed is None
    return bench


def approaching(
    pad: tuple[float, float] = (2.5, 0.0), answer: Answer | Says = ADVANCE, **seen: Any
) -> LeafBench:
    bench = searching(answer)
    assert fly(bench, pad, **seen) is Status.RUNNING
    assert bench.board[PHASE] == "approach"
    return bench


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


def marked(x_m: float, y_m: float, *, seen_s: float = 1.0, std_m: float = 0.03) -> SiteMap:
    """Return ground of 4 x 4 m with the landing mark on it; the drone is in the middle."""
    return replace(drawn_map(), mark=MapMark(x_m=x_m, y_m=y_m, std_m=std_m, seen_s=seen_s))


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


def boxed(*places_m: tuple[float, float], pad: tuple[float, float] = (2.5, 0.0)) -> SiteMap:
    """Return ground of 6 x 6 m with obstacles and the mark, relative to the drone, at one side."""
    return replace(
        drawn_map(ground_m=6.0, pose=(-1.5, 0.0, 0.0)),
        obstacles_m=np.array([(x_m - 1.5, y_m) for x_m, y_m in places_m]),
        mark=MapMark(x_m=pad[0] - 1.5, y_m=pad[1], std_m=0.03, seen_s=0.1),
    )


def unseen(site_map: SiteMap, hidden: Any) -> SiteMap:
    """Return the map without the ground of these cells."""
    seen_s = np.where(hidden, -math.inf, site_map.seen_s)
    return replace(site_map, free=site_map.free & ~hidden, seen_s=seen_s)


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


# The last metre.


@pytest.mark.parametrize("end", [(0.1, 0.0), (-0.02, 0.15), None])
def test_the_last_metre_goes_by_the_track(end: tuple[float, float] | None) -> None:
    """The pad has left the view below: on towards where it must be, until above it or past it.

    Without the track it stops and searches. A track that led nowhere is not flown to again.
    """
    bench = approaching((1.2, 0.0))
    assert fly(bench, (1.0, 0.0), unseen_s=0.6) is Status.RUNNING
    assert fly(bench, (0.9, 0.0), unseen_s=0.7) is Status.RUNNING
    assert 0.0 < velocity(bench).forward_mps < 0.6
    assert fly(bench, (0.3, 0.0), unseen_s=2.0) is Status.RUNNING
    assert fly(bench, end, unseen_s=2.6) is (Status.RUNNING if end is None else Status.SUCCESS)
    assert bench.proposed is None
    assert (bench.pointed is None) == (end is not None)
    assert (bench.board[PHASE] == "search") == (end is None)
    fly(bench, (0.3, 0.0), unseen_s=2.71, std_m=0.05)
    assert (bench.board[PHASE] == "search") == (end is not None)


def test_almost_above_the_pad_a_map_that_is_stale_permits_nothing() -> None:
    bench = approaching((1.2, 0.0), TURN_RIGHT)
    bench.board[SITE_MAP] = map_with(NearObstacles(captured_s=bench.clock.now()))
    bench.allow_stale()
    bench.clock.advance(5.0)
    for _ in range(12):
        show(bench)
        bench.board[MARK] = fix(bench.clock.now(), 0.4)
        bench.tick()
        assert bench.proposed is None or velocity(bench).forward_mps == 0.0
    assert velocity(bench).yaw_rate_radps > 0.0


def test_a_pad_beyond_the_grounds_edge_is_not_flown_to() -> None:
    site_map = drawn_map()
    site_map.outside[:] = True
    bench = searching()
    for shown, phase in ((site_map, "search"), (drawn_map(), "approach")):
        fly(bench, pad=(1.5, 0.0), site_map=shown)
        assert bench.board[PHASE] == phase


def test_a_drone_that_does_not_get_on_gives_up() -> None:
    """Neither the map nor the policy leads it out of its corner. The mission lands then."""
    bench, shut = searching(TURN_RIGHT), corner(0.4)
    mark, status, seconds = shut.pose.to_body(*MARK_M), Status.RUNNING, 0.0
    while status is Status.RUNNING and seconds < 90.0:
        here = OdometryPose(x_m=0.0, y_m=0.0, yaw_rad=0.0, time_s=bench.clock.now())
        bench.board[ODOMETRY] = motion(here, tracked_s=0.0)
        status, seconds = fly(bench, mark, site_map=shut, seconds=0.5), seconds + 0.5
    assert status is Status.FAILURE
    assert seconds == pytest.approx(60.0, abs=2.0)


@pytest.mark.parametrize(("hidden_m", "crosses"), [(0.8, True), (1.9, False)])
def test_unseen_ground_is_crossed_beside_the_pad_only(hidden_m: float, *, crosses: bool) -> None:
    """Far from it the cells may be the hidden side of a box."""
    site_map = boxed((5.0, 5.0))
    site_map = unseen(site_map, np.abs(site_map.places_m()[..., 0] - (1.0 - hidden_m)) < 0.25)
    maps = ClearanceMaps(site_map, RecentObstacles(), Margins(), over=(1.0, 0.0))
    assert (maps.route_to((1.0, 0.0), near_m=0.15, far_m=0.15) is not None) == crosses


def test_to_a_mark_far_beyond_the_known_ground_it_flies_to_where_that_ends() -> None:
    """A metre of it ahead; from there more is seen, and the policy is not asked."""
    known, policy = boxed((9.0, 9.0), pad=(4.0, 0.0)), Says(TURN_RIGHT)
    bench = searching(policy)
    beyond = known.places_m()[..., 0] >= -0.5  # the drone is at -1.5
    fly(bench, (4.0, 0.0), site_map=unseen(known, beyond))
    assert velocity(bench).forward_mps > 0.2
    assert policy.views == []


# The distances that the place asks for.

Y_M = np.arange(-2.0, 2.01, 0.05)
GAP_M = np.column_stack([np.zeros(len(Y_M)), Y_M])[np.abs(Y_M) > 0.38]
BEHIND_A_GAP = replace(
    drawn_map(obstacles=GAP_M, pose=(-0.8, 0.0, 0.0)),
    mark=MapMark(x_m=1.0, y_m=0.0, std_m=0.03, seen_s=0.1),
)


def test_the_way_to_the_mark_keeps_the_distance_that_the_place_asks_for() -> None:
    for obstacle_m, seen, flown in (
        # A wall has a gap that leaves 0.4 m to either side. The narrowest gap before the mark
        # keeps 0.23 m by default, and 0.43 m in the second place.
        (0.4, {"pad": (1.8, 0.0), "site_map": BEHIND_A_GAP}, True),
        (0.6, {"pad": (1.8, 0.0), "site_map": BEHIND_A_GAP}, False),
        # An obstacle lies 0.6 m beside the straight way; 0.12 m more than the distance are kept.
        (0.4, {"pad": (2.5, 0.0), "obstacles": [(1.0, 0.6)]}, True),
        (0.55, {"pad": (2.5, 0.0), "obstacles": [(1.0, 0.6)]}, False),
    ):
        bench = returning(TURN_LEFT)
        bench.provide(clearances=Clearances(obstacle_m=obstacle_m))
        for _ in range(5):
            fly(bench, **seen)
        ahead = isinstance(bench.proposed, Velocity) and bench.proposed.forward_mps > 0.0
        assert ahead == flown


# Under a policy.

FREE = Advance(forward_m=0.8, free_m=0.9, reason="clear")
NO_WAY = Blocked(yaw_rad=0.5, free_m=0.1, reason="obstacle")
EDGE = Blocked(yaw_rad=0.5, ground_ends=True, free_m=1.0, reason="edge")


def asked(answer: Answer | Says, pad: tuple[float, float] = (2.0, 0.0)) -> LeafBench:
    """Return a bench with a pad 2 m ahead, on which the policy has been asked."""
    bench = returning(answer, approach="policy")
    fly(bench, pad)
    assert velocity(bench).forward_mps == 0.0  # frames are older than the approach
    fly(bench, pad, seconds=0.3)
    return bench


@pytest.mark.parametrize(
    ("answer", "free"),
    [
        (FREE, True),
        (EDGE, True),  # the ground may end behind the pad
        (ADVANCE, True),  # without a distance the kind of the answer counts
        (replace(FREE, forward_m=0.3, free_m=0.2), True),  # a step that it would take is room
        (FollowLeg(speed_mps=0.2), True),
        (TURN_RIGHT, False),
        (Done(), False),
        (replace(EDGE, free_m=0), False),
        (replace(EDGE, free_m=np.float32(0.1)), False),
    ],
)
def test_flies_to_the_pad_while_the_policy_finds_the_way_free(
    answer: Answer, *, free: bool
) -> None:
    bench = asked(answer)
    assert bench.board[PHASE] == "approach"
    if free:
        assert velocity(bench).forward_mps > 0.0
        return
    for _ in range(2):
        fly(bench, (2.0, 0.0), seconds=0.3)
    assert bench.proposed == Velocity(yaw_rate_radps=0.6)


def test_turns_to_the_pad_before_anybody_is_asked() -> None:
    policy = Says(NO_WAY)
    turn = velocity(asked(policy, (1.0, 1.0)))
    assert policy.views == []
    assert (turn.forward_mps, turn.yaw_rate_radps > 0.0) == (0.0, True)


def test_a_detour_goes_to_the_side_of_the_last_one() -> None:
    """Whichever side the policy would choose from the end of that detour."""
    policy, yaw_rad, stepped = Says(NO_WAY), 0.0, False
    bench = asked(policy)
    for _ in range(2):
        fly(bench, (2.0, 0.0), seconds=0.3)
    assert bench.proposed == Velocity(yaw_rate_radps=0.6)
    policy.answers = [FREE]
    while not stepped:
        if isinstance(bench.proposed, Velocity):
            yaw_rad += 0.3 * bench.proposed.yaw_rate_radps
        show(bench, seconds=0.3, yaw_rad=yaw_rad)
        bench.tick()
        if isinstance(bench.proposed, MoveBy):
            stepped = bench.proposed.forward_m > 0.0
            bench.finish_movement()
            bench.tick()
    policy.answers = [replace(NO_WAY, yaw_rad=-0.5)]
    for _ in range(3):
        fly(bench, (2.0, 0.0), seconds=0.3)
    assert bench.proposed == Velocity(yaw_rate_radps=0.6)


def test_a_pad_is_only_flown_over_unseen_where_it_is_below_the_view() -> None:
    for range_m, forward_mps in ((1.2, 0.45), (1.5, 0.0)):
        bench = asked(Says(FREE, NO_WAY))
        for unseen_s in (0.6, 1.2, 1.8):
            fly(bench, (range_m, 0.0), seconds=0.6, unseen_s=unseen_s)
        assert velocity(bench).forward_mps == pytest.approx(forward_mps)


def test_an_unknown_approach_is_refused() -> None:
    with pytest.raises(InputError, match="got 'memry'; did you mean 'memory'"):
        returning(approach="memry")
