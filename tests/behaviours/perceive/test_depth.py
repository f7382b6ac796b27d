"""The depth leaves: once per frame, with the frame's own telemetry, SUCCESS always."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from behaviours.perceive.depth import BuildCorridor, EstimateDepth
from perception.camera.ground_plane import CameraView, ground_depth
from perception.depth.metric import LEAST_CONFIDENCE
from tests.paper_lab import BACKGROUND, BOXES, CARPET, CLASSES, HELIPAD_H
from tests.worlds import values
from uav_bt.board import CAMERA as CAMERA_KEY
from uav_bt.board import CLASS_MAP, CORRIDOR, FRAME, METRIC_DEPTH, ODOMETRY, RELATIVE_DEPTH
from uav_bt.board.context import MissionContext
from uav_bt.errors import AnswerError, InputError
from uav_bt.lab.classes import LabClass, LabClasses, RoleName
from uav_bt.lab.shipped import default_mark
from uav_bt.protocols import DepthEstimator
from uav_bt.testing import LeafBench, pinhole
from uav_bt.testing.world import show
from uav_bt.tree import Status
from uav_bt.types import BodyVelocity, Corridor, DepthMap, Frame
from uav_bt.types.dead_reckoning import OdometryPose

SIZE = (224, 112)
CAMERA = pinhole(640, 360)
PITCH_RAD = math.radians(-28.0)
GROUND = np.full(SIZE[::-1], CARPET, dtype=np.uint8)
ALL = (0, 112, 0, 224)
Things = Sequence[tuple[int, int, int, int, int]]  # rows and columns, from and to, and a class


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
        depth = np.nan_to_num(ground_depth(view), nan=50.0) * np.float32(0.2)
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
    things: Things = (),
    *,
    classes: LabClasses = CLASSES,
    height_m: float = 1.5,
    speed_mps: float = 0.0,
    grey: int = 90,
) -> Status:
    """Show a frame after a tenth of a second, with a class map of ground and things, and tick."""
    bench.camera, ids = CAMERA, GROUND.copy()
    for top, bottom, left, right, class_id in things:
        ids[top:bottom, left:right] = class_id
    speed = BodyVelocity(forward_mps=speed_mps)
    show(bench, ids=ids, gimbal_deg=-28.0, height_m=height_m, velocity=speed)
    bench.board[CLASS_MAP] = replace(bench.board[CLASS_MAP], classes=classes)
    frame = bench.board[FRAME]
    bench.board[FRAME] = replace(frame, image=np.full_like(frame.image, grey))
    return bench.tick()


@pytest.fixture
def estimating() -> LeafBench:
    """Return the leaf with a network that runs in every frame."""
    Loaded.network = Network()
    return LeafBench(Loaded, network_ahead_m=20.0)


def ground_m(row: int, column: int) -> float:
    """Return the depth of the ground at a pixel."""
    view = CameraView(camera=CAMERA.resized(*SIZE), pitch_rad=PITCH_RAD, height_m=1.5)
    return float(ground_depth(view)[row, column])


def test_relative_and_metric_depth_are_written_once_and_as_old_as_the_frame(
    estimating: LeafBench,
) -> None:
    """Ground that passes too fast lowers the confidence."""
    assert fly(estimating) is Status.SUCCESS
    relative, metric = estimating.board[RELATIVE_DEPTH], estimating.board[METRIC_DEPTH]
    assert not relative.metric
    assert metric.metric
    assert metric.captured_s == relative.captured_s == pytest.approx(0.1)
    assert metric.depth[80, 100] == pytest.approx(ground_m(80, 100), rel=1e-3)
    estimating.tick()
    assert len(Loaded.network.frames) == 1
    pose = OdometryPose(x_m=0.0, y_m=0.0, yaw_rad=0.0, time_s=0.1)
    estimating.board[ODOMETRY] = values.motion(pose, stretch=1.4)
    fly(estimating)
    assert metric.confidence > 0.5
    assert estimating.board[METRIC_DEPTH].confidence < 0.3
    times = estimating.leaf.mission.stage_times_s
    assert len(Loaded.network.frames) == len(times["relative_depth"]) == 2
    assert len(times["metric_depth"]) == 2


def test_the_leaf_trusts_the_same_scales_as_the_evaluation() -> None:
    (port,) = (port for port in EstimateDepth.ports if port.name == "least_confidence")
    assert port.default == LEAST_CONFIDENCE


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
    frame, leaf = bench.board[FRAME], bench.leaf
    depth = np.full((56, 112), 2.0, np.float32)
    given = DepthMap(depth=depth, metric=False, captured_s=frame.captured_s, in_heights=True)
    bench.board[RELATIVE_DEPTH] = given
    assert isinstance(leaf, EstimateDepth)
    assert leaf._load("any", leaf.mission).estimate(frame) is given


@pytest.mark.parametrize(
    ("things", "runs", "measured"),
    [
        pytest.param([(10, 60, 100, 124, BOXES[0])], 0, True, id="the base is in view"),
        pytest.param([(10, 112, 100, 124, BOXES[0])], 1, True, id="the base is below"),
        pytest.param(
            [
                (0, 20, 0, 224, BACKGROUND),
                (20, 25, 100, 124, BOXES[0]),
                (25, 30, 100, 124, BOXES[1]),
            ],
            *(0, False),
            id="another obstacle, 3 m ahead, hides it",
        ),
    ],
)
def test_the_network_runs_if_a_near_obstacle_has_no_base_in_view(
    things: Things, runs: int, *, measured: bool
) -> None:
    """By default ground contact alone measures frames in which it knows all near obstacles."""
    Loaded.network = Network()
    bench = LeafBench(Loaded)
    fly(bench, things)
    assert len(Loaded.network.frames) == runs
    assert (RELATIVE_DEPTH in bench.board) == bool(runs)
    assert np.isfinite(bench.board[METRIC_DEPTH].depth[22, 110]) == measured


@pytest.mark.parametrize("height_m", [0.05, 0.4])
def test_contact_flies_without_a_network_and_knows_the_height_of_the_mark(height_m: float) -> None:
    """Of the depth at which a ray meets the ground, it is the share (1.5 m - height) / 1.5 m."""
    bench = LeafBench(EstimateDepth, model="contact")
    bench.provide(mark=replace(default_mark(), height_m=height_m))
    box, wall = (0, 60, 100, 120, BOXES[0]), (0, 20, 0, 224, BACKGROUND)
    assert fly(bench, [box, wall, (70, 85, 100, 125, HELIPAD_H)]) is Status.SUCCESS
    depth_m = bench.board[METRIC_DEPTH].depth
    assert depth_m[75, 110] == pytest.approx((1.5 - height_m) / 1.5 * ground_m(75, 110))
    assert np.isfinite(depth_m[40, 110])
    assert np.isnan(depth_m[5, 5])
    assert RELATIVE_DEPTH not in bench.board


def test_a_refused_frame_writes_none_and_says_why(estimating: LeafBench) -> None:
    """While it hovers the same picture twice is nothing odd."""
    assert fly(estimating, grey=0) is Status.SUCCESS
    assert METRIC_DEPTH not in estimating.board
    assert estimating.feedback == "no depth: the frame is black"
    fly(estimating, height_m=0.0)
    assert "no height" in estimating.feedback
    square = np.full((300, 300, 3), 90, dtype=np.uint8)
    estimating.board[FRAME] = replace(estimating.board[FRAME], image=square, index=7)
    assert estimating.tick() is Status.SUCCESS
    assert "300x300" in estimating.feedback
    assert "another aspect" in estimating.feedback
    assert METRIC_DEPTH not in estimating.board
    for _ in range(2):
        fly(estimating)
        assert estimating.feedback == ""
    before = estimating.board[METRIC_DEPTH].captured_s
    fly(estimating, speed_mps=0.5)
    assert estimating.feedback == "no depth: the image is frozen"
    assert estimating.board[METRIC_DEPTH].captured_s == before
    fly(estimating, speed_mps=0.5, grey=91)
    assert estimating.feedback == ""


# BuildCorridor.

BOX_AHEAD = [(10, 80, 100, 124, BOXES[3])]


def corridor_of(
    depth_m: float,
    things: Things,
    classes: LabClasses = CLASSES,
    speed_mps: float = 0.0,
    **ports: object,
) -> Corridor:
    """Return the corridor of a frame whose depth is the same everywhere."""
    bench = LeafBench(BuildCorridor, **ports)
    depth = np.full(SIZE[::-1], depth_m, dtype=np.float32)
    bench.board[METRIC_DEPTH] = DepthMap(depth=depth, metric=True, captured_s=0.1)
    assert fly(bench, things, classes=classes, speed_mps=speed_mps) is Status.SUCCESS
    return bench.board[CORRIDOR]


def test_a_corridor_is_built_from_this_frames_depth() -> None:
    corridor = corridor_of(1.0, BOX_AHEAD, speed_mps=0.5)
    assert corridor.captured_s == pytest.approx(0.1)
    assert corridor.nearest_side is not None
    assert 0.5 < corridor.nearest_m < 1.3
    assert corridor.time_to_impact_s == pytest.approx((corridor.free_distance_m - 0.12) / 0.5)
    narrow = corridor_of(1.0, BOX_AHEAD, front_m=0.9, side_m=0.3, up_down_m=0.5)
    assert narrow.nearest_side is None


ROLES: tuple[RoleName, ...] = ("outside", "obstacle", "mark", "mark", "ground")
OTHER = LabClasses(
    LabClass(name=f"class_{k}", role=role, colour=(0, 0, 0)) for k, role in enumerate(ROLES)
)


def test_the_ground_is_no_obstacle_and_background_only_where_asked() -> None:
    for class_id, classes, background, counts in (
        (CARPET, CLASSES, True, False),
        (BACKGROUND, CLASSES, False, False),
        (BACKGROUND, CLASSES, True, True),
        (1, OTHER, False, True),  # the role counts, not the number
        (4, OTHER, False, False),
    ):
        found = corridor_of(0.4, [(*ALL, class_id)], classes, background=background)
        assert (found.nearest_side is not None) == counts


@pytest.mark.parametrize(("lens_m", "least"), [(None, "0.17"), (0.6, "0.62")])
def test_a_front_plane_that_the_lens_has_passed_is_refused_at_setup(
    lens_m: float | None, least: str
) -> None:
    """Without a camera on the board the lens is the ANAFI's."""
    near, far = (LeafBench(BuildCorridor, front_m=float(least) + each) for each in (-0.01, 0.01))
    if lens_m is not None:
        for bench in (near, far):
            bench.board[CAMERA_KEY] = replace(CAMERA, forward_offset_m=lens_m)
    with pytest.raises(InputError, match=rf"front_m must be more than {least} m .* lens"):
        near.setup()
    far.setup()


def test_depth_of_another_frame_builds_nothing() -> None:
    bench = LeafBench(BuildCorridor)
    bench.board[METRIC_DEPTH] = DepthMap(
        depth=np.ones(SIZE[::-1], dtype=np.float32), metric=True, captured_s=0.0
    )
    assert fly(bench) is Status.SUCCESS
    assert CORRIDOR not in bench.board
