"""MapSite: the map of the place, once per class map, carried along with the drone."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from behaviours.perceive.site_map import MapSite
from tests.paper_lab import BOXES, CARPET
from tests.worlds.leaves import replace_tree
from tests.worlds.values import motion
from uav_bt.board import CAMERA, CLASS_MAP, FRAME, ODOMETRY, SITE_MAP
from uav_bt.board.blackboard import Key
from uav_bt.testing import LeafBench, pinhole
from uav_bt.testing.world import show
from uav_bt.tree import Status
from uav_bt.types.dead_reckoning import OdometryPose


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


def live(
    bench: LeafBench, *, seconds: float = 0.1, yaw_rad: float = 0.0, ids: np.ndarray | None = None
) -> Status:
    """Show the leaf a world of now, and tick it."""
    show(bench, seconds=seconds, yaw_rad=yaw_rad, ids=ids)
    reckon(bench, yaw_rad=yaw_rad)
    return bench.tick()


def test_a_box_in_view_is_near_after_a_turn() -> None:
    bench = mapping()
    assert live(bench, ids=box_map()) is Status.SUCCESS
    ahead = bench.board[SITE_MAP].near
    assert len(ahead.points_m) > 5
    assert ahead.captured_s == bench.clock.now()
    live(bench, yaw_rad=math.pi / 2)
    aside = bench.board[SITE_MAP].near
    assert aside.points_m[:, 1] == pytest.approx(-ahead.points_m[:, 0])
    assert aside.points_m[:, 0] == pytest.approx(ahead.points_m[:, 1])


def test_between_two_views_the_map_moves_along_with_the_drone() -> None:
    bench = mapping()
    live(bench, ids=box_map())
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
    live(bench, ids=box_map())
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
    live(bench)
    show(bench, ids=box_map())
    reckon(bench, seen_s=bench.clock.now() - 0.1)
    bench.tick()
    near = bench.board[SITE_MAP].near
    assert near.points_m.shape == (0, 2)
    assert near.captured_s == pytest.approx(bench.clock.now() - 0.1)  # of the view without a box


def test_the_map_is_kept_when_another_tree_takes_over() -> None:
    bench = mapping()
    live(bench, ids=box_map())
    known = bench.board[SITE_MAP]
    ahead = known.near
    replace_tree(bench, MapSite())
    live(bench, seconds=0.5, yaw_rad=math.pi / 2)  # the box is out of view
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
        live(bench, ids=ids)
    live(bench, seconds=61.0)
    higher, back = (event.text for event in bench.notes.events)
    assert higher.startswith("a mover at start:")
    assert higher.endswith("leaves that give way fly 0.5 m higher")
    assert back == "no mover for 60 s: leaves that give way return to the flight height"
