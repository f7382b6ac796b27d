"""ReturnToBase: the last metre by the track, and the approach under a policy."""

from dataclasses import replace

import numpy as np
import pytest

from behaviours.path.margins import Margins
from behaviours.path.nearby import RecentObstacles
from behaviours.path.passages import ClearanceMaps
from tests.behaviours.fly.return_world import approaching, boxed, fly, returning, searching, unseen
from tests.behaviours.path.drawn_maps import MARK as MARK_M
from tests.behaviours.path.drawn_maps import corner
from tests.worlds.leaves import ADVANCE, TURN_LEFT, TURN_RIGHT, map_with, velocity
from tests.worlds.values import fix, motion
from uav_bt.answers import Advance, Answer, Blocked, Done, FollowLeg
from uav_bt.board import MARK, ODOMETRY, PHASE, SITE_MAP
from uav_bt.errors import InputError
from uav_bt.testing import LeafBench
from uav_bt.testing.world import Says, drawn_map, show
from uav_bt.tree import Status
from uav_bt.types import Clearances, MoveBy, NearObstacles, Velocity
from uav_bt.types.dead_reckoning import OdometryPose
from uav_bt.types.site_map import MapMark


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
