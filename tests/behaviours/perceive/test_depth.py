"""The depth leaves: once per frame, with the frame's own telemetry, SUCCESS always."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from behaviours.perceive.depth import BuildCorridor, EstimateDepth
from perception.camera.ground_plane import CameraView, ground_depth
from perception.depth.metric import LEAST_CONFIDENCE
from tests.paper_lab import BACKGROUND, BOXES, CARPET, CLASSES, HELIPAD_H, paper_map
from tests.worlds import values
from tests.worlds.values import motion
from uav_bt.board import CAMERA as CAMERA_KEY
from uav_bt.board import CLASS_MAP, CORRIDOR, FRAME, METRIC_DEPTH, ODOMETRY, RELATIVE_DEPTH
from uav_bt.board.context import MissionContext
from uav_bt.errors import AnswerError, InputError
from uav_bt.lab.classes import LabClass, LabClasses, RoleName
from uav_bt.lab.shipped import default_mark
from uav_bt.protocols import DepthEstimator
from uav_bt.testing import LeafBench, pinhole
from uav_bt.tree import Status
from uav_bt.types import (
    BodyVelocity,
    ClassMap,
    DepthMap,
    DroneState,
    FlyingState,
    Frame,
)
from uav_bt.types.dead_reckoning import OdometryPose

SIZE = (224, 112)
CAMERA = pinhole(640, 360)
PITCH_RAD = math.radians(-28.0)
UNIT = 0.2


class Network:
    """A depth network that is exact in an arbitrary unit and keeps its frames."""

    def __init__(self) -> None:
        self.frames: list[Frame] = []
        self.holed = False

    def estimate(self, frame: Frame) -> DepthMap:
        """Return the ground plane's depth."""
        self.frames.append(frame)
        if self.holed:
            raise AnswerError("net.onnx", "one is not positive")
        view = CameraView(
            camera=CAMERA.resized(80, 64),
            pitch_rad=frame.gimbal_pitch_rad,
            height_m=max(frame.height_above_ground_m, 0.1),
        )
        depth = np.nan_to_num(ground_depth(view), nan=50.0) * np.float32(UNIT)
        return DepthMap(depth=depth, metric=False, captured_s=frame.captured_s)


class Loaded(EstimateDepth):
    """The leaf with that network in place of a file's."""

    network = Network()

    @staticmethod
    def _load(model: str, mission: MissionContext) -> DepthEstimator:
        del model, mission
        return Loaded.network


def fly(
    bench: LeafBench,
    *,
    ids: np.ndarray | None = None,
    classes: LabClasses = CLASSES,
    height_m: float = 1.5,
    speed_mps: float = 0.0,
    grey: int = 90,
) -> Status:
    """Let a tenth of a second pass, show a frame with its class map, and tick."""
    bench.camera = CAMERA
    bench.clock.advance(0.1)
    now = bench.clock.now()
    bench.observe(
        DroneState(
            captured_s=now,
            flying=FlyingState.FLYING,
            velocity=BodyVelocity(forward_mps=speed_mps),
            height_above_ground_m=height_m,
            gimbal_pitch_rad=PITCH_RAD,
        )
    )
    frame = bench.board[FRAME]
    picture = np.full_like(frame.image, grey)
    bench.board[FRAME] = values.frame(
        picture, PITCH_RAD, height_m, captured_s=now, index=frame.index
    )
    shown = np.full(SIZE[::-1], CARPET, dtype=np.uint8) if ids is None else ids
    bench.board[CLASS_MAP] = ClassMap(ids=shown, classes=classes, captured_s=now)
    return bench.tick()


@pytest.fixture
def estimating() -> LeafBench:
    """Return the leaf with a network that runs in every frame."""
    Loaded.network = Network()
    return LeafBench(Loaded, network_ahead_m=20.0)


# --- EstimateDepth --------------------------------------------------------------------------------


def test_relative_and_metric_depth_are_written_as_old_as_the_frame(estimating: LeafBench) -> None:
    assert fly(estimating) is Status.SUCCESS

    relative, metric = estimating.board[RELATIVE_DEPTH], estimating.board[METRIC_DEPTH]
    assert not relative.metric
    assert metric.metric
    assert metric.captured_s == relative.captured_s == pytest.approx(0.1)
    view = CameraView(camera=CAMERA.resized(*SIZE), pitch_rad=PITCH_RAD, height_m=1.5)
    assert metric.depth[80, 100] == pytest.approx(ground_depth(view)[80, 100], rel=1e-3)


def test_the_leaf_trusts_the_same_scales_as_the_evaluation() -> None:
    (port,) = (port for port in EstimateDepth.ports if port.name == "least_confidence")
    assert port.default == LEAST_CONFIDENCE


def test_ground_that_passes_too_fast_lowers_the_confidence(estimating: LeafBench) -> None:
    fly(estimating)
    before = estimating.board[METRIC_DEPTH].confidence
    pose = OdometryPose(x_m=0.0, y_m=0.0, yaw_rad=0.0, time_s=0.1)
    estimating.board[ODOMETRY] = motion(pose, tracked_s=0.1, stretch=1.4)
    fly(estimating)
    assert before > 0.5
    assert estimating.board[METRIC_DEPTH].confidence < 0.3


def test_each_frame_is_estimated_once(estimating: LeafBench) -> None:
    fly(estimating)
    estimating.tick()
    estimating.tick()
    assert len(Loaded.network.frames) == 1
    fly(estimating)
    assert len(Loaded.network.frames) == 2
    times = estimating.leaf.mission.stage_times_s
    assert len(times["relative_depth"]) == len(times["metric_depth"]) == 2


def test_a_frame_without_an_answer_has_no_depth(estimating: LeafBench) -> None:
    """The mission flies on, and the report has one warning."""
    for holed in (False, True, True, False):
        Loaded.network.holed = holed
        assert fly(estimating) is Status.SUCCESS
        fresh = estimating.board[METRIC_DEPTH].captured_s == estimating.board[FRAME].captured_s
        assert fresh is not holed
        assert estimating.feedback == ("no depth: net.onnx: one is not positive" if holed else "")
    assert len(estimating.notes.events) == 1


def test_the_depth_of_the_segmentation_replaces_that_of_any() -> None:
    bench = LeafBench(EstimateDepth, model="any")
    bench.setup()
    bench.hover()
    frame = bench.board[FRAME]
    given = DepthMap(
        depth=np.full((56, 112), 2.0, np.float32),
        metric=False,
        captured_s=frame.captured_s,
        in_heights=True,
    )
    bench.board[RELATIVE_DEPTH] = given
    leaf = bench.leaf
    assert isinstance(leaf, EstimateDepth)
    assert leaf._load("any", leaf.mission).estimate(frame) is given


@pytest.mark.parametrize(
    ("rows", "runs"),
    [
        pytest.param(slice(10, 60), 0, id="the base is in view"),
        pytest.param(slice(10, 112), 1, id="the base is below the image"),
    ],
)
def test_the_network_runs_if_a_near_obstacle_has_no_base_in_view(rows: slice, runs: int) -> None:
    """By default ground contact alone measures frames in which it knows all near obstacles."""
    Loaded.network = Network()
    bench = LeafBench(Loaded)
    ids = np.full(SIZE[::-1], CARPET, dtype=np.uint8)
    ids[rows, 100:124] = BOXES[0]
    fly(bench, ids=ids)
    assert len(Loaded.network.frames) == runs
    assert (RELATIVE_DEPTH in bench.board) == bool(runs)
    assert np.isfinite(bench.board[METRIC_DEPTH].depth[40, 110])


def test_the_network_does_not_run_for_a_far_obstacle_without_a_base() -> None:
    """Another obstacle, 3 m ahead, hides the base of the one behind it."""
    Loaded.network = Network()
    bench = LeafBench(Loaded)
    ids = np.full(SIZE[::-1], CARPET, dtype=np.uint8)
    ids[:20] = BACKGROUND
    ids[20:25, 100:124] = BOXES[0]
    ids[25:30, 100:124] = BOXES[1]
    fly(bench, ids=ids)
    assert Loaded.network.frames == []
    assert np.isnan(bench.board[METRIC_DEPTH].depth[22, 110])


def test_contact_flies_without_a_network() -> None:
    """No weights are loaded and no relative depth is written."""
    bench = LeafBench(EstimateDepth, model="contact")
    ids = np.full(SIZE[::-1], CARPET, dtype=np.uint8)
    ids[:60, 100:120] = BOXES[0]
    ids[:20] = BACKGROUND

    assert fly(bench, ids=ids) is Status.SUCCESS
    metric = bench.board[METRIC_DEPTH]
    assert np.isfinite(metric.depth[40, 110])
    assert np.isnan(metric.depth[5, 5])
    assert RELATIVE_DEPTH not in bench.board


@pytest.mark.parametrize("height_m", [0.05, 0.4])
def test_contact_knows_the_height_of_the_mark(height_m: float) -> None:
    """Of the depth at which a ray meets the ground, it is the share (1.5 m - height) / 1.5 m."""
    bench = LeafBench(EstimateDepth, model="contact")
    bench.provide(mark=replace(default_mark(), height_m=height_m))
    ids = np.full(SIZE[::-1], CARPET, dtype=np.uint8)
    ids[70:85, 100:125] = HELIPAD_H
    fly(bench, ids=ids)
    view = CameraView(camera=CAMERA.resized(*SIZE), pitch_rad=PITCH_RAD, height_m=1.5)
    share = (1.5 - height_m) / 1.5
    expected_m = share * ground_depth(view)[75, 110]
    assert bench.board[METRIC_DEPTH].depth[75, 110] == pytest.approx(expected_m)


def test_a_refused_frame_writes_none_and_says_why(estimating: LeafBench) -> None:
    assert fly(estimating, grey=0) is Status.SUCCESS
    assert METRIC_DEPTH not in estimating.board
    assert estimating.feedback == "no depth: the frame is black"

    fly(estimating, height_m=0.0)
    assert "no height" in estimating.feedback
    fly(estimating)
    assert estimating.feedback == ""
    assert METRIC_DEPTH in estimating.board


def test_a_frozen_picture_of_a_moving_drone_is_refused(estimating: LeafBench) -> None:
    """While it hovers the same picture twice is nothing odd."""
    fly(estimating)
    fly(estimating)
    assert estimating.feedback == ""
    first = estimating.board[METRIC_DEPTH].captured_s
    fly(estimating, speed_mps=0.5)
    assert estimating.feedback == "no depth: the image is frozen"
    assert estimating.board[METRIC_DEPTH].captured_s == first
    fly(estimating, speed_mps=0.5, grey=91)
    assert estimating.feedback == ""


def test_a_frame_of_another_aspect_than_its_camera_is_refused(estimating: LeafBench) -> None:
    estimating.hover()
    square = values.frame(
        np.full((300, 300, 3), 90, dtype=np.uint8),
        PITCH_RAD,
        captured_s=estimating.clock.now(),
        index=7,
    )
    estimating.board[FRAME] = square
    estimating.board[CLASS_MAP] = paper_map(
        np.full(SIZE[::-1], CARPET, dtype=np.uint8), square.captured_s
    )

    assert estimating.tick() is Status.SUCCESS
    assert "300x300" in estimating.feedback
    assert "another aspect" in estimating.feedback
    assert METRIC_DEPTH not in estimating.board


def test_a_misspelt_source_is_refused_at_setup() -> None:
    with pytest.raises(InputError, match="did you mean 'fused'"):
        LeafBench(Loaded, source="fusd")


# --- BuildCorridor --------------------------------------------------------------------------------


def box_ahead() -> np.ndarray:
    """Return a map of ground with things in its middle columns."""
    ids = np.full(SIZE[::-1], CARPET, dtype=np.uint8)
    ids[10:80, 100:124] = BOXES[3]
    return ids


def show_depth(
    bench: LeafBench,
    depth_m: float,
    ids: np.ndarray,
    classes: LabClasses = CLASSES,
    **world: float,
) -> Status:
    """Show a frame of that class map, and its depth, the same everywhere."""
    fly_on = bench.clock.now() + 0.1
    bench.board[METRIC_DEPTH] = DepthMap(
        depth=np.full(SIZE[::-1], depth_m, dtype=np.float32), metric=True, captured_s=fly_on
    )
    return fly(bench, ids=ids, classes=classes, **world)


def test_a_corridor_is_built_from_this_frames_depth() -> None:
    bench = LeafBench(BuildCorridor)
    assert show_depth(bench, 1.0, box_ahead(), speed_mps=0.5) is Status.SUCCESS

    corridor = bench.board[CORRIDOR]
    assert corridor.captured_s == pytest.approx(0.1)
    assert corridor.nearest_side is not None
    assert 0.5 < corridor.nearest_m < 1.3
    assert corridor.time_to_impact_s == pytest.approx((corridor.free_distance_m - 0.12) / 0.5)


def test_the_ground_is_no_obstacle_and_background_only_where_asked() -> None:
    ground = np.full(SIZE[::-1], CARPET, dtype=np.uint8)
    nothing = np.full(SIZE[::-1], BACKGROUND, dtype=np.uint8)
    sides = {}
    for name, ids, background in (
        ("ground", ground, True),
        ("hidden", nothing, False),
        ("shown", nothing, True),
    ):
        bench = LeafBench(BuildCorridor, background=background)
        show_depth(bench, 0.4, ids)
        sides[name] = bench.board[CORRIDOR].nearest_side
    assert sides["ground"] is None
    assert sides["hidden"] is None
    assert sides["shown"] is not None


def test_what_counts_follows_the_role_of_a_class_not_its_number() -> None:
    """In this lab class 1 is an obstacle, and class 4 is ground."""
    roles: tuple[RoleName, ...] = ("outside", "obstacle", "mark", "mark", "ground")
    lab = LabClasses(
        LabClass(name=f"class_{k}", role=role, colour=(0, 0, 0)) for k, role in enumerate(roles)
    )
    sides = []
    for class_id in (1, 4):
        bench = LeafBench(BuildCorridor)
        show_depth(bench, 0.4, np.full(SIZE[::-1], class_id, dtype=np.uint8), lab)
        sides.append(bench.board[CORRIDOR].nearest_side)
    assert sides[0] is not None
    assert sides[1] is None


def test_walls_stand_where_the_file_puts_them() -> None:
    bench = LeafBench(BuildCorridor, front_m=0.9, side_m=0.3, up_down_m=0.5)
    show_depth(bench, 1.0, box_ahead())
    assert bench.board[CORRIDOR].nearest_side is None


@pytest.mark.parametrize(("lens_m", "least"), [(None, "0.17"), (0.6, "0.62")])
def test_a_front_plane_that_the_lens_has_passed_is_refused_at_setup(
    lens_m: float | None, least: str
) -> None:
    """Without a camera on the board the lens is the ANAFI's."""
    for front_m, refused in ((float(least) - 0.01, True), (float(least) + 0.01, False)):
        bench = LeafBench(BuildCorridor, front_m=front_m)
        if lens_m is not None:
            bench.board[CAMERA_KEY] = replace(CAMERA, forward_offset_m=lens_m)
        if refused:
            with pytest.raises(InputError, match=rf"front_m must be more than {least} m .* lens"):
                bench.setup()
        else:
            bench.setup()


def test_depth_of_another_frame_builds_nothing() -> None:
    bench = LeafBench(BuildCorridor)
    bench.board[METRIC_DEPTH] = DepthMap(
        depth=np.ones(SIZE[::-1], dtype=np.float32), metric=True, captured_s=0.0
    )
    assert fly(bench) is Status.SUCCESS
    assert CORRIDOR not in bench.board
