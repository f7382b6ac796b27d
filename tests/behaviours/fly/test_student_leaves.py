"""Leaves around the control student: recent views, advice, a veto, a path to the pad."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from behaviours.fly.explore import CorridorClear, Explore
from behaviours.perceive.recent_views import Advise, RememberViews
from tests.worlds import values
from tests.worlds.leaves import (
    ADVANCE,
    RETURN_TO_BASE,
    TURN_LEFT,
    TURN_RIGHT,
    map_with,
    steering_bench,
)
from tests.worlds.values import corridor
from uav_bt.answers import Advance, Answer, Blocked, Done, FollowLeg
from uav_bt.board import (
    ADVICE,
    CORRIDOR,
    FRAME,
    HELD_TURN,
    MARK,
    PHASE,
    RECENT_VIEWS,
    SITE_MAP,
)
from uav_bt.errors import InputError
from uav_bt.testing import LeafBench
from uav_bt.testing.world import Says, live, show
from uav_bt.tree import Status
from uav_bt.types import (
    BodyVelocity,
    HeldTurn,
    MoveBy,
    NearObstacles,
    PastView,
    RecentViews,
    Velocity,
)
from uav_bt.types.dead_reckoning import OdometryPose

# --- RememberViews --------------------------------------------------------------------------------


def remembering(seconds: float, **attributes: object) -> LeafBench:
    """Return a bench after a flight ahead at 0.5 m/s for a time, with frames all the time."""
    bench = LeafBench(RememberViews, **attributes)
    for _ in range(round(10 * seconds)):
        assert live(bench, velocity=BodyVelocity(forward_mps=0.5)) is Status.SUCCESS
    return bench


def test_views_are_kept_with_where_they_were_captured() -> None:
    recent = remembering(1.0).board[RECENT_VIEWS]
    assert len(recent.views) == 10
    then = recent.ago(0.5)
    assert recent.newest.frame.captured_s - then.frame.captured_s == pytest.approx(0.5)
    assert recent.newest.pose.x_m - then.pose.x_m == pytest.approx(0.25)
    assert recent.ago(0.0) is recent.newest


def test_old_views_are_let_go() -> None:
    views = remembering(2.0, keep_s=0.65).board[RECENT_VIEWS].views
    assert views[-1].frame.captured_s - views[0].frame.captured_s == pytest.approx(0.6)


def test_a_frame_that_comes_twice_is_one_view() -> None:
    bench = remembering(0.5)
    bench.tick()
    assert len(bench.board[RECENT_VIEWS].views) == 5


# --- what policies are shown ----------------------------------------------------------------------


def remember(bench: LeafBench) -> None:
    """Write that the newest frame is the only one that is remembered."""
    pose = OdometryPose(time_s=0.0, x_m=1.0, y_m=2.0, yaw_rad=0.3)
    view = PastView(frame=bench.board[FRAME], pose=pose)
    bench.board[RECENT_VIEWS] = RecentViews(views=(view,))


def test_a_policy_is_shown_the_pixels() -> None:
    policy = Says(ADVANCE)
    bench = steering_bench(Explore, policy)
    live(bench)
    show(bench, seconds=0.3)
    remember(bench)
    bench.tick()
    recent = policy.views[-1].recent
    assert recent is not None
    assert recent.newest.frame is bench.board[FRAME]


def test_pixels_of_another_frame_are_not_shown() -> None:
    policy = Says(ADVANCE)
    bench = steering_bench(Explore, policy)
    live(bench)
    show(bench, seconds=0.2)
    remember(bench)
    show(bench, seconds=0.1)
    bench.tick()
    assert policy.views[-1].recent is None


# --- Advise ---------------------------------------------------------------------------------------


def advising(policy: Says) -> LeafBench:
    bench = LeafBench(Advise, policy="says")
    bench.policies["says"] = policy
    show(bench)
    remember(bench)
    return bench


def test_advice_says_what_the_policy_decides_and_where() -> None:
    bench = advising(Says(replace(ADVANCE, free_m=0.9)))
    assert bench.tick() is Status.SUCCESS
    advice, frame = bench.board[ADVICE], bench.board[FRAME]
    assert (advice.frame_index, advice.captured_s) == (frame.index, frame.captured_s)
    assert (advice.x_m, advice.y_m, advice.yaw_rad) == (1.0, 2.0, 0.3)
    assert (advice.height_above_ground_m, advice.turning) == (1.5, 0)
    assert advice.answer == advice.fresh == replace(ADVANCE, free_m=0.9)
    assert bench.proposed is None


def test_with_a_turn_under_way_it_also_asks_as_if_there_were_none() -> None:
    policy = Says(TURN_LEFT, TURN_RIGHT)
    bench = advising(policy)
    bench.board[HELD_TURN] = HeldTurn(direction=-1, turned_rad=7.0)
    bench.tick()
    advice = bench.board[ADVICE]
    assert (advice.turning, advice.full_turns) == (-1, 1)
    assert (advice.answer, advice.fresh) == (TURN_LEFT, TURN_RIGHT)
    assert [(view.turning, view.full_turns) for view in policy.views] == [(-1, 1), (0, 0)]


def test_each_view_is_asked_about_once() -> None:
    policy = Says(ADVANCE)
    bench = advising(policy)
    bench.tick()
    bench.tick()
    assert len(policy.views) == 1


# --- CorridorClear --------------------------------------------------------------------------------


def room(
    ahead_m: float = 3.0,
    *,
    impact_s: float = math.inf,
    obstacle: tuple[float, float] | None = None,
) -> Status:
    """Return the status of the condition for this room."""
    bench = LeafBench(CorridorClear, ahead_m=0.6, impact_s=0.8, beside_m=0.4)
    show(bench)
    now_s = bench.clock.now()
    bench.board[CORRIDOR] = corridor(ahead_m, "front", captured_s=now_s, impact_s=impact_s)
    if obstacle is not None:
        bench.board[SITE_MAP] = map_with(
            NearObstacles(points_m=np.array([obstacle]), captured_s=now_s)
        )
    return bench.tick()


def test_a_free_corridor_is_clear() -> None:
    assert room() is Status.SUCCESS
    assert room(obstacle=(1.5, 0.0)) is Status.SUCCESS


def test_too_little_room_ahead_is_not() -> None:
    assert room(0.61) is Status.SUCCESS
    assert room(0.59) is Status.FAILURE


def test_too_much_speed_for_the_room_is_not() -> None:
    assert room(1.0, impact_s=0.9) is Status.SUCCESS
    assert room(1.0, impact_s=0.7) is Status.FAILURE


def test_an_obstacle_that_has_left_the_view_counts() -> None:
    assert room(obstacle=(0.5, 0.0)) is Status.FAILURE
    assert room(obstacle=(0.2, 0.45)) is Status.SUCCESS


def test_what_lies_behind_may_be_left() -> None:
    assert room(obstacle=(-0.3, 0.0)) is Status.SUCCESS


def off_the_ground(pad: tuple[float, float] | None = None) -> Status:
    """Return the status of the condition without ground in view, with or without a pad."""
    bench = LeafBench(CorridorClear)
    show(bench, ids=np.zeros((18, 32), dtype=np.uint8))
    now_s = bench.clock.now()
    if pad is not None:
        bench.board[MARK] = values.fix(now_s, pad[0], pad[1])
    bench.board[CORRIDOR] = corridor(3.0, nearest_m=math.inf, captured_s=now_s)
    return bench.tick()


def test_where_the_ground_ends_is_no_room() -> None:
    assert off_the_ground() is Status.FAILURE


@pytest.mark.parametrize("pad", [(1.5, 0.1), (-0.1, 0.3)])
def test_on_the_way_to_the_pad_the_ground_may_end_behind_it(pad: tuple[float, float]) -> None:
    assert off_the_ground(pad) is Status.SUCCESS


def test_on_another_way_it_may_not() -> None:
    assert off_the_ground((1.0, 1.0)) is Status.FAILURE


# --- ReturnToBase under a policy ------------------------------------------------------------------

FREE = Advance(forward_m=0.8, free_m=0.9, reason="clear")
NO_WAY = Blocked(yaw_rad=0.5, free_m=0.1, reason="obstacle")
EDGE = Blocked(yaw_rad=0.5, ground_ends=True, free_m=1.0, reason="edge")


def fly(bench: LeafBench, pad: tuple[float, float], *, seconds: float = 0.3) -> Status:
    show(bench, seconds=seconds)
    bench.board[MARK] = values.fix(bench.clock.now(), pad[0], pad[1])
    return bench.tick()


def approaching(policy: Says) -> LeafBench:
    """Return a bench with a pad 2 m ahead, on which the policy has been asked."""
    bench = steering_bench(RETURN_TO_BASE, policy, gimbal_deg=-30.0, approach="policy")
    fly(bench, (2.0, 0.0))
    fly(bench, (2.0, 0.0))
    return bench


def speed(bench: LeafBench) -> float:
    assert isinstance(bench.proposed, Velocity)
    return bench.proposed.forward_mps


@pytest.mark.parametrize(
    ("answer", "free"),
    [
        (FREE, True),
        (EDGE, True),  # the ground may end behind the pad
        (ADVANCE, True),  # without a distance the kind of the answer counts
        (FollowLeg(speed_mps=0.2), True),
        (NO_WAY, False),
        (TURN_RIGHT, False),
        (Done(), False),
        (replace(EDGE, free_m=0), False),
        (replace(EDGE, free_m=np.float32(0.1)), False),
    ],
)
def test_flies_to_the_pad_while_the_policy_finds_the_way_free(
    answer: Answer, *, free: bool
) -> None:
    bench = approaching(Says(answer))
    assert bench.board[PHASE] == "approach"
    if free:
        assert speed(bench) == pytest.approx(0.45)
        return
    for _ in range(2):
        fly(bench, (2.0, 0.0))
    assert bench.proposed == Velocity(yaw_rate_radps=0.6)


def test_turns_to_the_pad_before_anybody_is_asked() -> None:
    policy = Says(NO_WAY)
    bench = steering_bench(RETURN_TO_BASE, policy, gimbal_deg=-30.0, approach="policy")
    fly(bench, (1.0, 1.0))
    fly(bench, (1.0, 1.0))
    assert policy.views == []
    assert isinstance(bench.proposed, Velocity)
    assert (bench.proposed.forward_mps, bench.proposed.yaw_rate_radps > 0.0) == (0.0, True)


def test_waits_for_a_view_that_was_judged() -> None:
    """In the first ticks of an approach the frames are older than it."""
    bench = steering_bench(RETURN_TO_BASE, Says(FREE), gimbal_deg=-30.0, approach="policy")
    fly(bench, (2.0, 0.0), seconds=0.1)
    assert speed(bench) == 0.0


def test_a_step_that_the_policy_would_take_is_room() -> None:
    """Relieved, it advances where its distance is short."""
    assert speed(approaching(Says(replace(FREE, forward_m=0.3, free_m=0.2)))) > 0.0


def test_a_detour_goes_to_the_side_of_the_last_one() -> None:
    """Whichever side the policy would choose from the end of that detour."""
    policy = Says(NO_WAY)
    bench = approaching(policy)
    yaw_rad = 0.0
    for _ in range(2):
        fly(bench, (2.0, 0.0))
    assert bench.proposed == Velocity(yaw_rate_radps=0.6)
    policy.answers = [FREE]
    for _ in range(30):
        if isinstance(bench.proposed, Velocity):
            yaw_rad += 0.3 * bench.proposed.yaw_rate_radps
        show(bench, seconds=0.3, yaw_rad=yaw_rad)
        bench.tick()
        if isinstance(bench.proposed, MoveBy):
            stepped = bench.proposed.forward_m > 0.0
            bench.finish_movement()
            bench.tick()
            if stepped:
                break
    policy.answers = [replace(NO_WAY, yaw_rad=-0.5)]
    for _ in range(3):
        fly(bench, (2.0, 0.0))
    assert bench.proposed == Velocity(yaw_rate_radps=0.6)


@pytest.mark.parametrize(("range_m", "forward_mps"), [(1.2, 0.45), (1.5, 0.0)])
def test_a_pad_is_only_flown_over_unseen_where_it_is_below_the_view(
    range_m: float, forward_mps: float
) -> None:
    """Further away something hides it."""
    bench = approaching(Says(FREE, NO_WAY))
    fix = values.fix(bench.clock.now(), range_m, detected=False)
    for _ in range(3):
        show(bench, seconds=0.6)
        bench.board[MARK] = fix
        bench.tick()
    assert speed(bench) == pytest.approx(forward_mps)


def test_an_unknown_approach_is_refused() -> None:
    with pytest.raises(InputError, match="got 'memry'; did you mean 'memory'"):
        steering_bench(RETURN_TO_BASE, Says(FREE), approach="memry")
