"""The perception leaves: once per frame, with the frame's own telemetry, SUCCESS always."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from behaviours.perceive.class_map import FindMark, Segment
from tests.paper_lab import HELIPAD_BOX, HELIPAD_H, paper_map
from tests.perception.marks.mark_views import (
    GROUND_CAMERA,
    TAG_CAMERA,
    ground_view,
    tag_mark,
    texture,
    view_of,
)
from tests.worlds.leaves import replace_tree
from tests.worlds.values import motion
from uav_bt.board import CAMERA, CLASS_MAP, FRAME, MARK, ODOMETRY, SITE_MAP, STATE
from uav_bt.board.blackboard import Key
from uav_bt.errors import AnswerError, InputError
from uav_bt.lab.shipped import default_mark
from uav_bt.landing_marks import MarkSighting
from uav_bt.plugins import make_mark_finder
from uav_bt.testing import LeafBench, pinhole
from uav_bt.testing.world import drawn_map, ground, live, show
from uav_bt.tree import Status
from uav_bt.types import BodyVelocity, ClassMap, Frame, Pose2D
from uav_bt.types.dead_reckoning import OdometryPose


class Counts:
    """A segmenter that sees ground everywhere and keeps the frames it was given."""

    def __init__(self) -> None:
        self.frames: list[Frame] = []
        self.no_number = False

    def segment(self, frame: Frame) -> ClassMap:
        """Return ground."""
        self.frames.append(frame)
        if self.no_number:
            raise AnswerError("net.onnx", "holds NaN")
        return paper_map(ids=ground(), captured_s=frame.captured_s)


def test_each_frame_is_segmented_and_timed_once_and_may_have_no_answer() -> None:
    """Then the mission flies on, and the report has one warning."""
    bench, network = LeafBench(Segment), Counts()
    bench.provide(segmenter=network)
    for count, no_number in enumerate((False, True, True, False), 1):
        network.no_number = no_number
        bench.hover()
        for _ in range(2):
            assert bench.tick(advance_s=0.1) is Status.SUCCESS
        assert len(network.frames) == len(bench.leaf.mission.stage_times_s["segmentation"]) == count
        fresh = bench.board[CLASS_MAP].captured_s == bench.board[FRAME].captured_s
        assert fresh is not no_number
    assert [event.text for event in bench.notes.events] == ["no class map: net.onnx: holds NaN"]


def pad_map() -> np.ndarray:
    """Return a 224x112 map of ground with a pad seen from ahead, its H centred at (112, 40)."""
    ids = np.ones((112, 224), dtype=np.uint8)
    ids[35:46, 100:125] = HELIPAD_H
    ids[46:60, 100:125] = HELIPAD_BOX
    return ids


def finding() -> LeafBench:
    bench = LeafBench(FindMark)
    bench.camera = pinhole(640, 360)
    return bench


@pytest.mark.parametrize("top_m", [0.4, 0.05])
def test_a_pad_in_view_gets_a_fix(top_m: float) -> None:
    """Straight ahead, where the pitch and the height above the pad or mat put it."""
    bench = finding()
    bench.provide(mark=replace(default_mark(), height_m=top_m))
    assert live(bench, ids=pad_map()) is Status.SUCCESS
    fix = bench.board[MARK]
    camera = bench.camera.resized(224, 112)
    below_axis = math.atan((40 - camera.cy_px) / camera.fy_px)
    expected_m = (1.5 - top_m) / math.tan(math.radians(30) + below_axis) + camera.forward_offset_m
    assert fix.detected
    assert (fix.captured_s, fix.height_m) == (bench.clock.now(), top_m)
    assert fix.forward_m == pytest.approx(expected_m, abs=1e-6)
    assert fix.right_m == pytest.approx(0.0, abs=0.02)


def test_a_tag_is_found_in_the_image_without_a_class_map() -> None:
    bench = finding()
    mark = tag_mark(height_m=0.0)
    bench.provide(mark=mark)
    picture = make_mark_finder(mark).picture()
    assert picture is not None
    shown = view_of(picture, mark, forward_m=1.2, heading_deg=30.0, pitch_deg=-45.0)
    bench.camera = TAG_CAMERA
    live(bench, gimbal_deg=-45.0)
    del bench.board[CLASS_MAP]
    bench.clock.advance(0.1)
    bench.board[FRAME] = replace(shown, index=99, captured_s=bench.clock.now())
    bench.tick()
    fix = bench.board[MARK]
    assert fix.detected
    assert fix.forward_m - TAG_CAMERA.forward_offset_m == pytest.approx(1.2, abs=0.01)
    assert fix.height_m == 0.0
    assert fix.heading_deg == pytest.approx(30.0, abs=1.0)


@pytest.mark.parametrize("mark", ["spot", "place"])
def test_the_take_off_spot_is_found_by_its_ground_where_the_map_is_wrong(mark: str) -> None:
    """After a flight of 2 m the map's take-off pose is 0.3 m wrong; the texture is right."""
    bench, floor = LeafBench(FindMark, mark=mark), texture()
    bench.camera = GROUND_CAMERA
    live(bench, gimbal_deg=-90.0)
    for x_m in (0.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0):
        pose = Pose2D(x_m=x_m, y_m=0.0, yaw_rad=0.0)
        bench.clock.advance(0.1)
        now_s = bench.clock.now()
        if x_m == 2.0 or SITE_MAP in bench.board:
            start = Pose2D(x_m=0.3, y_m=0.0, yaw_rad=0.0)
            bench.board[SITE_MAP] = replace(drawn_map(), pose=pose, start=start, captured_s=now_s)
        bench.board[FRAME] = ground_view(floor, pose, at_s=now_s).frame
        bench.tick()

    if mark == "place":
        assert MARK not in bench.board  # another mark is not replaced by the spot
    else:
        fix = bench.board[MARK]
        assert fix.detected
        assert fix.height_m == 0.0
        assert math.hypot(fix.forward_m, fix.right_m) < 0.03


def test_without_images_a_tag_is_seen_by_the_drones_sight() -> None:
    class TagSight:  # only `mark` is asked
        def mark(self, frame: Frame) -> MarkSighting:
            ahead_m = float(frame.index)
            return MarkSighting(forward_m=ahead_m, right_m=0.0, height_m=0.0, heading_deg=5.0)

    bench = finding()
    bench.provide(mark=tag_mark(), sight=TagSight())
    live(bench)
    fix = bench.board[MARK]
    assert (fix.forward_m, fix.heading_deg) == pytest.approx((bench.board[FRAME].index, 5.0))


@pytest.mark.parametrize(("error_mps", "moved_m"), [(None, -0.475), (0.0, -0.475), (-0.5, 0.0)])
def test_a_pad_that_leaves_the_view_is_carried(error_mps: float | None, moved_m: float) -> None:
    """By telemetry, or as the drone moves over the ground; and it says since when it is unseen."""
    bench = finding()
    live(bench, ids=pad_map())
    seen, moved = bench.board[MARK], None
    if error_mps is not None:
        pose = OdometryPose(time_s=bench.clock.now(), x_m=0.0, y_m=0.0, yaw_rad=0.0)
        over, error = (BodyVelocity(right_mps=mps) for mps in (0.5 + error_mps, error_mps))
        moved = motion(pose, velocity=over, error=error)
    for _ in range(10):
        show(bench, ids=ground(), velocity=BodyVelocity(right_mps=0.5))
        if moved is not None:
            pose = replace(moved.pose, time_s=bench.clock.now())
            bench.board[ODOMETRY] = replace(moved, pose=pose)
        bench.tick()
    fix = bench.board[MARK]
    assert not fix.detected
    assert fix.captured_s == seen.captured_s
    assert fix.right_m - seen.right_m == pytest.approx(moved_m, abs=0.03)
    assert fix.std_m > seen.std_m


def test_an_unknown_mark_is_refused_before_the_first_view() -> None:
    for kind, options, message in (
        ("region", {"class": "nope"}, "unknown class with the role mark 'nope'.*helipad_h"),
        ("region", {"klass": "nope"}, "landing mark 'region' has no option 'klass'"),
    ):
        bench = finding()
        bench.provide(mark=replace(default_mark(), kind=kind, options=options))
        with pytest.raises(InputError, match=message):
            bench.tick()


@pytest.mark.parametrize("missing", [STATE, FRAME, CLASS_MAP, CAMERA, None])
def test_without_a_pad_from_below_it_and_without_inputs_it_finds_nothing(
    missing: Key[Any] | None,
) -> None:
    """Neither in a class map of another frame, with another pitch."""
    bench = finding()
    for view in ({}, {"ids": pad_map(), "height_m": 0.3}):
        assert live(bench, **view) is Status.SUCCESS
        assert MARK not in bench.board
    show(bench, ids=pad_map())
    if missing is None:
        bench.clock.advance(0.1)
        bench.hover(gimbal_pitch_rad=math.radians(-60))
    else:
        del bench.board[missing]
    assert bench.tick() is Status.SUCCESS
    assert MARK not in bench.board


def test_a_pads_track_is_kept_by_the_next_tree_and_dropped_where_the_map_begins_anew() -> None:
    bench = finding()
    live(bench, ids=pad_map())
    replace_tree(bench, FindMark())
    del bench.board[MARK]
    live(bench)
    carried = bench.board[MARK]
    assert not carried.detected
    bench.board[SITE_MAP] = replace(drawn_map(), restarts=1, captured_s=bench.clock.now())
    bench.tick()
    assert bench.board[MARK] is carried  # the last written fix; nothing was written since
