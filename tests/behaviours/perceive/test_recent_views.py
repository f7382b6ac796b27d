"""RememberViews and Advise: recent views, what policies are shown of them, and advice."""

from dataclasses import replace

import pytest

from behaviours.fly.explore import Explore
from behaviours.perceive.recent_views import Advise, RememberViews
from tests.worlds.leaves import ADVANCE, TURN_LEFT, TURN_RIGHT, steering_bench
from uav_bt.board import ADVICE, FRAME, HELD_TURN, RECENT_VIEWS
from uav_bt.testing import LeafBench
from uav_bt.testing.world import Says, live, show
from uav_bt.tree import Status
from uav_bt.types import BodyVelocity, HeldTurn, PastView, RecentViews
from uav_bt.types.dead_reckoning import OdometryPose


def remembering(seconds: float, **attributes: object) -> LeafBench:
    """Return a bench after a flight ahead at 0.5 m/s for a time, with frames all the time."""
    bench = LeafBench(RememberViews, **attributes)
    for _ in range(round(10 * seconds)):
        assert live(bench, velocity=BodyVelocity(forward_mps=0.5)) is Status.SUCCESS
    return bench


def test_views_are_kept_for_a_while_with_where_they_were_captured() -> None:
    """A frame that comes twice is one view."""
    bench = remembering(1.0)
    bench.tick()
    recent = bench.board[RECENT_VIEWS]
    assert len(recent.views) == 10
    then = recent.ago(0.5)
    assert recent.newest.frame.captured_s - then.frame.captured_s == pytest.approx(0.5)
    assert recent.newest.pose.x_m - then.pose.x_m == pytest.approx(0.25)
    assert recent.ago(0.0) is recent.newest
    views = remembering(2.0, keep_s=0.65).board[RECENT_VIEWS].views
    assert views[-1].frame.captured_s - views[0].frame.captured_s == pytest.approx(0.6)


def remember(bench: LeafBench) -> None:
    """Write that the newest frame is the only one that is remembered."""
    pose = OdometryPose(time_s=0.0, x_m=1.0, y_m=2.0, yaw_rad=0.3)
    view = PastView(frame=bench.board[FRAME], pose=pose)
    bench.board[RECENT_VIEWS] = RecentViews(views=(view,))


@pytest.mark.parametrize("of_this_frame", [True, False])
def test_a_policy_is_shown_the_pixels_of_its_frame(*, of_this_frame: bool) -> None:
    policy = Says(ADVANCE)
    bench = steering_bench(Explore, policy)
    live(bench)
    show(bench, seconds=0.3)
    remember(bench)
    if not of_this_frame:
        show(bench)
    bench.tick()
    recent = policy.views[-1].recent
    assert (recent is not None) == of_this_frame
    assert recent is None or recent.newest.frame is bench.board[FRAME]


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
    for _ in range(2):  # each view is asked about once
        bench.tick()
    advice = bench.board[ADVICE]
    assert (advice.turning, advice.full_turns) == (-1, 1)
    assert (advice.answer, advice.fresh) == (TURN_LEFT, TURN_RIGHT)
    assert [(view.turning, view.full_turns) for view in policy.views] == [(-1, 1), (0, 0)]
