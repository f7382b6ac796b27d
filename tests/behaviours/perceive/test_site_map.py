"""From the motion over the ground to the site map and the views that it remembers."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from behaviours.fly.explore import Explore
from behaviours.perceive.recent_views import Advise, RememberViews
from behaviours.perceive.site_map import MapSite, TrackMotion
from tests.paper_lab import BOXES, CARPET
from tests.worlds.leaves import ADVANCE, TURN_LEFT, TURN_RIGHT, replace_tree, steering_bench
from tests.worlds.values import motion
from uav_bt.board import (
    ADVICE,
    CAMERA,
    CLASS_MAP,
    FRAME,
    HELD_TURN,
    ODOMETRY,
    RAISED,
    RECENT_VIEWS,
    SITE_MAP,
    STATE,
)
from uav_bt.board.blackboard import Key
from uav_bt.testing import LeafBench, pinhole
from uav_bt.testing.world import Says, live, show
from uav_bt.tree import Status
from uav_bt.types import BodyVelocity, DroneState, FlyingState, HeldTurn, PastView, RecentViews
from uav_bt.types.dead_reckoning import OdometryPose


def tracking() -> LeafBench:
    bench = LeafBench(TrackMotion)
    bench.camera = pinhole(640, 360)
    return bench


def test_the_motion_is_written_every_tick_from_the_first_class_map_on() -> None:
    """Between two frames, too; by telemetry alone until ground is followed, never without it."""
    bench = tracking()
    show(bench)
    del bench.board[STATE]
    assert bench.tick() is Status.SUCCESS
    assert ODOMETRY not in bench.board
    live(bench)
    first = bench.board[ODOMETRY]
    assert first.seen == first.pose
    bench.clock.advance(0.1)
    bench.observe(DroneState(captured_s=bench.clock.now(), flying=FlyingState.FLYING))
    bench.tick()
    then = bench.board[ODOMETRY]
    assert then.pose.time_s == bench.clock.now()
    assert then.seen == first.seen
    assert (then.error, then.tracked_s) == (BodyVelocity(), -math.inf)


@pytest.mark.parametrize("missing", [FRAME, CLASS_MAP, CAMERA])
def test_without_a_view_telemetry_is_integrated(missing: Key[Any]) -> None:
    """0.5 m/s for 0.1 s, from standing still: 2.5 cm."""
    bench = tracking()
    live(bench)
    show(bench, velocity=BodyVelocity(forward_mps=0.5))
    del bench.board[missing]
    assert bench.tick() is Status.SUCCESS
    assert bench.board[ODOMETRY].pose.x_m == pytest.approx(0.025)


def test_the_frame_of_the_poses_is_kept_when_another_tree_takes_over() -> None:
    bench = tracking()
    live(bench)
    live(bench, velocity=BodyVelocity(forward_mps=0.5))
    flown_m = bench.board[ODOMETRY].pose.x_m
    replace_tree(bench, TrackMotion())
    live(bench, velocity=BodyVelocity(forward_mps=0.5))
    assert bench.board[ODOMETRY].pose.x_m == pytest.approx(flown_m + 0.05)


# --- MapSite --------------------------------------------------------------------------------------


def box_map() -> np.ndarray:
    ids = np.full((112, 224), CARPET, dtype=np.uint8)
    ids[:70, 100:130] = BOXES[0]
    return ids


def mapping() -> LeafBench:
    bench = LeafBench(MapSite)
    bench.camera = pinhole(640, 360)
    return bench


def reckon(bench: LeafBench, *, yaw_rad: float = 0.0, seen_s: float | None = None) -> None:
    """Write the odometry of a drone that only turns; it saw the newest frame."""
    pose = OdometryPose(time_s=bench.clock.now(), x_m=0.0, y_m=0.0, yaw_rad=yaw_rad)
    seen = pose if seen_s is None else replace(pose, time_s=seen_s)
    bench.board[ODOMETRY] = replace(motion(pose), seen=seen)


def look(
    bench: LeafBench, *, seconds: float = 0.1, yaw_rad: float = 0.0, ids: np.ndarray | None = None
) -> Status:
    """Show the leaf a world of now, and tick it."""
    show(bench, seconds=seconds, yaw_rad=yaw_rad, ids=ids)
    reckon(bench, yaw_rad=yaw_rad)
    return bench.tick()


def test_a_box_in_view_is_near_after_a_turn() -> None:
    bench = mapping()
    assert look(bench, ids=box_map()) is Status.SUCCESS
    ahead = bench.board[SITE_MAP].near
    assert len(ahead.points_m) > 5
    assert ahead.captured_s == bench.clock.now()
    look(bench, yaw_rad=math.pi / 2)
    aside = bench.board[SITE_MAP].near
    assert aside.points_m[:, 1] == pytest.approx(-ahead.points_m[:, 0])
    assert aside.points_m[:, 0] == pytest.approx(ahead.points_m[:, 1])


def test_between_two_views_the_map_moves_along_with_the_drone() -> None:
    bench = mapping()
    look(bench, ids=box_map())
    ahead, captured_s = bench.board[SITE_MAP].near, bench.clock.now()
    bench.clock.advance(0.1)
    reckon(bench, yaw_rad=math.pi / 2, seen_s=captured_s)
    bench.tick()
    found = bench.board[SITE_MAP]
    assert found.pose.yaw_rad == pytest.approx(math.pi / 2)
    assert found.near.points_m[:, 1] == pytest.approx(-ahead.points_m[:, 0])
    assert found.near.points_age_s == pytest.approx(0.1)
    assert found.captured_s == captured_s


@pytest.mark.parametrize("missing", [FRAME, CLASS_MAP, CAMERA, ODOMETRY])
def test_blind_it_claims_nothing_new(missing: Key[Any]) -> None:
    """The board keeps the last map, which ages. Without odometry it names the missing leaf."""
    bench = mapping()
    look(bench, ids=box_map())
    before = bench.board[SITE_MAP]
    show(bench, ids=box_map())
    reckon(bench)
    del bench.board[missing]
    assert bench.tick() is Status.SUCCESS
    assert bench.board[SITE_MAP].captured_s == before.captured_s
    assert ("<TrackMotion/>" in bench.feedback) == (missing is ODOMETRY)


def test_a_frame_that_the_odometry_has_not_seen_is_not_placed() -> None:
    """Its pose is unknown: the view waits."""
    bench = mapping()
    look(bench)
    show(bench, ids=box_map())
    reckon(bench, seen_s=bench.clock.now() - 0.1)
    bench.tick()
    near = bench.board[SITE_MAP].near
    assert near.points_m.shape == (0, 2)
    assert near.captured_s == pytest.approx(bench.clock.now() - 0.1)  # of the view without a box


def test_the_map_is_kept_when_another_tree_takes_over() -> None:
    bench = mapping()
    look(bench, ids=box_map())
    known = bench.board[SITE_MAP]
    ahead = known.near
    replace_tree(bench, MapSite())
    look(bench, seconds=0.5, yaw_rad=math.pi / 2)  # the box is out of view
    aside = bench.board[SITE_MAP].near
    assert aside.points_m[:, 1] == pytest.approx(-ahead.points_m[:, 0])
    site_map = bench.board[SITE_MAP]
    assert site_map.captured_s > known.captured_s
    assert (site_map.seen_s == known.captured_s).any()  # ground that only it had seen


def test_events_tell_of_the_climb_for_a_mover_and_of_its_end() -> None:
    bench = mapping()
    for step in range(40):
        ids = np.full((112, 224), CARPET, dtype=np.uint8)
        if step > 10:
            ids[:70, 30 + 4 * step : 50 + 4 * step] = BOXES[0]
        look(bench, ids=ids)
    assert not bench.notes.events  # no leaf gives way
    for raised_m in (0.5, 0.0):  # by the leaf that flies
        bench.board[RAISED] = raised_m
        look(bench)
    higher, back = (event.text for event in bench.notes.events)
    assert higher.startswith("flies 0.5 m higher: a mover at start:")
    assert back == "flies at the flight height again: no mover for 60 s"


# --- RememberViews and Advise ---------------------------------------------------------------------


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
