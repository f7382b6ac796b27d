"""The coverage policy: heading, speed, a look round without a way, and the end."""

import math
from dataclasses import replace

import numpy as np
import pytest

from behaviours.policies.coverage_policy import CoveragePolicy
from tests.behaviours.path.drawn_maps import corner, where
from tests.behaviours.policies.cast_world import cast, view
from tests.worlds.values import corridor
from uav_bt.answers import Answer, Blocked, Done, FollowLeg, Rotate
from uav_bt.errors import MissionError
from uav_bt.testing.world import drawn_map
from uav_bt.types import Clearances
from uav_bt.types.site_map import SiteMap

ALL = np.ones((61, 61), dtype=bool)
AHEAD = drawn_map(passed=where("left"), pose=(0.0, -0.2, math.pi / 2))


def decide(site_map: SiteMap | None, **seen: object) -> Answer:
    return CoveragePolicy().decide(view(cast(), site_map=site_map, **seen))


def test_without_a_map_it_says_which_leaf_makes_one() -> None:
    with pytest.raises(MissionError, match="<TrackMotion/> and <MapSite/>"):
        decide(None)


def test_without_ground_it_looks_round_and_nothing_is_covered() -> None:
    nowhere = drawn_map()
    nowhere = replace(nowhere, seen_s=np.full_like(nowhere.seen_s, -np.inf))
    for full_turns in (0, 1, 3):
        decision = decide(nowhere, full_turns=full_turns)
        assert isinstance(decision, Blocked)
        assert decision.reason == "no ground seen"


def test_by_a_map_that_the_view_contradicts_it_does_not_fly() -> None:
    assert isinstance(decide(replace(AHEAD, contradicted_s=0.5)), FollowLeg | Rotate)
    assert isinstance(decide(replace(AHEAD, contradicted_s=1.5)), Blocked)
    assert not isinstance(decide(replace(AHEAD, contradicted_s=1.5), full_turns=2), Done)


@pytest.mark.parametrize(("yaw_deg", "side"), [(60, -1), (120, 1), (-60, -1), (-120, 1)])
def test_without_a_way_it_turns_to_where_the_ground_is(yaw_deg: float, side: int) -> None:
    """At the right edge, y = 1.9, the ground lies to the left of who looks outwards."""
    wall = np.column_stack([np.arange(-2.2, 2.3, 0.05), np.full(90, 1.4)])
    shut = drawn_map(obstacles=wall, passed=ALL, pose=(0.0, 1.9, math.radians(yaw_deg)))
    decision = decide(shut)
    assert isinstance(decision, Blocked)
    assert decision.reason == "no way"
    assert math.copysign(1.0, decision.yaw_rad) == side
    held = decide(shut, turning=-side)
    assert isinstance(held, Blocked)
    assert held.yaw_rad * side < 0.0  # a turn under way is held


def in_a_corner(yaw_deg: float) -> SiteMap:
    """Return the map of a drone that looked out of a corner: a patch ahead, and the outside."""
    x, y = np.indices((61, 61)) * 0.1 - 3.0
    patch = (x > 1.7) & (y > 1.6)
    corner = drawn_map(known=patch, pose=(1.7, 1.6, math.radians(yaw_deg)))
    ahead = np.abs(np.arctan2(y - 1.6, x - 1.7) - math.pi / 4) < math.radians(35)
    return replace(corner, outside=corner.outside & ahead, untracked_s=3.0)


def test_in_a_corner_it_turns_away_from_the_patch_that_it_saw() -> None:
    """A turn to the patch ahead ends at once, and the next view is the same."""
    yaw_deg, flown_deg = 45.0, 0.0
    while flown_deg < 60.0:  # with the tick's delay, in steps; the turn keeps its side
        decision = decide(in_a_corner(yaw_deg))
        assert isinstance(decision, Rotate)
        assert decision.reason == "turns to the ground"
        assert math.radians(30) < decision.yaw_rad <= math.pi
        yaw_deg, flown_deg = yaw_deg + 10.0, flown_deg + 10.0


OUTWARDS = {"pose": (0.0, 1.8, math.radians(90))}
HIDDEN = cast([(0.4, -2.0, 2.0)])  # by an obstacle


def test_when_it_looks_at_no_ground_for_long_it_turns_back_to_it() -> None:
    for drawn, ids, changes, turns in (
        (OUTWARDS, None, {"untracked_s": 1.5}, False),
        (OUTWARDS, None, {"untracked_s": 2.5}, True),
        # A plain floor has nothing to follow; turning would not help.
        ({}, None, {"untracked_s": 20.0}, False),
        # The map has ground in the view. Turns to a leg, and back to the ground, would alternate.
        ({}, None, {"untracked_s": 3.0}, False),
        ({}, HIDDEN, {"untracked_s": 3.0}, True),
        ({}, HIDDEN, {"untracked_s": 20.0}, False),
        # The map has ground there and no view shows it: the drone is not where it believes to be.
        ({}, None, {"captured_s": 4.0, "untracked_s": 3.0}, True),
    ):
        shown = view(
            cast() if ids is None else ids, site_map=replace(drawn_map(**drawn), **changes)
        )
        decision = CoveragePolicy().decide(shown)
        assert (decision.reason == "turns to the ground") == turns
        if turns and drawn:
            assert isinstance(decision, Rotate)
            assert abs(decision.yaw_rad) == pytest.approx(math.pi, abs=0.1)


def test_it_turns_before_it_flies_to_what_lies_behind_and_flies_to_what_it_faces() -> None:
    decision = decide(drawn_map(passed=where("right"), pose=(0.0, 0.5, math.pi / 2)))
    assert isinstance(decision, Rotate)
    assert abs(decision.yaw_rad) > math.radians(35)
    decision = decide(AHEAD)
    assert isinstance(decision, FollowLeg)
    assert decision.speed_mps > 0.25


@pytest.mark.parametrize(("free_m", "max_mps"), [(0.3, None), (0.4, 0.25), (0.6, 0.25), (1.0, 0.6)])
def test_what_the_corridor_shows_limits_the_speed(free_m: float, max_mps: float | None) -> None:
    answer = decide(AHEAD, corridor=corridor(free_m, "front"))
    if max_mps is None:
        assert isinstance(answer, Blocked)
    else:
        assert isinstance(answer, FollowLeg)
        assert answer.speed_mps <= max_mps


def test_covered_after_a_full_turn_without_a_leg() -> None:
    covered = drawn_map(passed=ALL)
    assert isinstance(decide(covered), Blocked)
    assert isinstance(decide(covered, full_turns=1), Done)


def test_a_drone_that_is_shut_in_leaves_through_the_gap_that_it_came_by() -> None:
    x_m = np.linspace(-2.0, 2.0, 41)
    wall = np.column_stack([x_m, np.full(41, -0.5)])[np.abs(x_m) > 0.29]
    behind = drawn_map(obstacles=wall, passed=where("left"), pose=(0.0, -1.0, math.pi / 2))
    assert isinstance(decide(behind), FollowLeg | Rotate)
    closed = replace(behind, obstacles_m=np.vstack([wall, [[0.0, -0.5]]]))
    assert isinstance(decide(closed), Blocked)


def test_a_drone_in_a_corner_explores_on_outside_it() -> None:
    """Without the way out it would turn until the time for exploring is over."""
    inside = replace(corner(0.5), passed=where("right"))
    assert isinstance(decide(inside), FollowLeg | Rotate)
    assert isinstance(decide(replace(corner(0.4), passed=where("right"))), Blocked)
    # Nothing is left to explore: it is covered, because the rest can be reached.
    assert isinstance(decide(replace(inside, passed=ALL), full_turns=1), Done)


def test_while_something_moves_nothing_is_covered_for_good() -> None:
    lane = replace(drawn_map(passed=ALL), lanes_m=np.array([[1.0, 1.0]]))
    assert isinstance(decide(lane, full_turns=1), Blocked)


def test_where_nowhere_is_room_enough_it_flies_the_narrow_way() -> None:
    """A passage of 0.6 m: covered only when that, too, was flown."""
    x_m = np.arange(-2.0, 2.01, 0.05)
    walls = np.vstack([np.column_stack([x_m, np.full(len(x_m), side)]) for side in (-0.3, 0.3)])
    x, y = np.indices((61, 61)) * 0.1 - 3.0
    between = (np.abs(y) <= 0.31) & (np.abs(x) <= 2.01)
    passage = drawn_map(obstacles=walls, known=between, pose=(-1.5, 0.0, 0.0))
    passage = replace(passage, outside=~between)
    decision = decide(passage, full_turns=1)
    assert isinstance(decision, FollowLeg | Rotate)
    # A place that asks for 0.5 m from obstacles has its narrowest passage at 0.4 m.
    further = decide(passage, full_turns=1, clearances=Clearances(obstacle_m=0.5))
    assert isinstance(further, Blocked | Done)
    assert isinstance(decide(replace(passage, passed=ALL), full_turns=1), Done)
