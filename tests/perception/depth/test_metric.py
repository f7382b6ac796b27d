"""Metric depth from network, contact or both, and every reason for refusing a frame."""

import math
from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType, SimpleNamespace
from typing import Any

import numpy as np
import pytest

from perception.depth.metric import (
    LEAST_CONFIDENCE,
    MetricDepth,
    MetricDepthMaker,
    remembered_bases,
)
from sim_bridge.anafi import anafi_camera
from sim_bridge.twin.camera import CameraPose
from sim_bridge.twin.objects import Helipad, ObjectSpec
from sim_bridge.twin.scene import Scene
from sim_bridge.twin.views import View, render_views
from tests.paper_lab import BACKGROUND, BOXES, CARPET, HELIPAD_H, paper_map
from tests.worlds import values
from uav_bt.types import DepthMap, NearObstacles, Pose2D
from uav_bt.types.dead_reckoning import OdometryPose

SIZE = (224, 112)
CAMERA = anafi_camera(160, 90)
PITCH_RAD = math.radians(-28.0)


@pytest.fixture(scope="module")
def drawn() -> View:
    """Return a box two metres ahead and one cut off on the left."""
    scene = Scene(
        name="two",
        helipad=Helipad(position_m=(-2.0, -1.5)),
        objects=(
            ObjectSpec(kind="box-1", position_m=(1.0, -0.2), size_m=(0.4, 0.4, 2.0)),
            ObjectSpec(kind="box-2", position_m=(-0.3, 0.45), size_m=(0.3, 0.3, 2.0)),
        ),
    )
    pose = CameraPose(x_m=-1.0, y_m=0.0, z_m=1.5, yaw_rad=0.0, pitch_rad=PITCH_RAD)
    (view,) = render_views(scene, [pose], size_px=(160, 90), truth_size_px=SIZE)
    return view


def make(
    drawn: View,
    source: str,
    network: np.ndarray | None = None,
    *,
    ids: np.ndarray | None = None,
    network_s: float = 3.0,
    changes: Mapping[str, Any] = MappingProxyType({}),
    **given: Any,
) -> MetricDepth:
    """Make metric depth of the frame, with a network that gives a depth in an arbitrary unit."""
    estimator: Any = None
    if network is not None:
        relative = DepthMap(depth=network * np.float32(0.25), metric=False, captured_s=network_s)
        estimator = SimpleNamespace(estimate=lambda _: relative)
    maker = MetricDepthMaker(estimator, source=source, generator=np.random.default_rng(0))
    shown = paper_map(ids=drawn.ids if ids is None else ids, captured_s=3.0)
    frame = replace(values.frame(drawn.image, PITCH_RAD, captured_s=3.0), **changes)
    return maker.make(frame, shown, CAMERA, **given)


def test_a_networks_depth_becomes_metres_at_the_size_of_the_class_map(drawn: View) -> None:
    made = make(drawn, "network", drawn.depth)
    assert made.refusal == ""
    assert made.depth.metric
    assert made.depth.captured_s == 3.0
    assert made.depth.depth == pytest.approx(drawn.depth, rel=2e-3)

    small = make(drawn, "network", np.ascontiguousarray(drawn.depth[::2, ::2])).depth.depth
    assert small.shape == (112, 224)
    assert np.median(np.abs(small - drawn.depth)[drawn.ids == CARPET]) < 0.02


def test_a_scale_that_is_not_trusted_leaves_depth_by_contact(drawn: View) -> None:
    """The network sees a wall at a constant depth."""
    made = make(drawn, "fused", np.ones_like(drawn.depth))
    assert np.isnan(made.depth.depth[drawn.ids == BOXES[1]]).all()
    assert made.scale is None
    scale = made.confidences["scale"]
    assert scale.value < LEAST_CONFIDENCE
    assert made.refusal == f"no scale: {scale.reason}"


def test_contact_needs_no_network_and_leaves_the_unknown_unknown(drawn: View) -> None:
    found = make(drawn, "contact").depth
    ahead, cut = drawn.ids == BOXES[0], drawn.ids == BOXES[1]
    assert np.nanmedian(np.abs(found.depth - drawn.depth)[ahead]) < 0.02
    assert np.isnan(found.depth[cut]).all()
    assert np.isnan(found.depth[drawn.ids == BACKGROUND]).all()
    assert 0.0 < found.confidence < 1.0


def test_fused_takes_contact_where_it_knows_and_the_network_within_its_bounds(drawn: View) -> None:
    """The network here is wrong on the box whose base is seen, then on the other one."""
    ahead, cut = drawn.ids == BOXES[0], drawn.ids == BOXES[1]
    fused = make(drawn, "fused", np.where(ahead, 1.5 * drawn.depth, drawn.depth)).depth
    error_m = np.abs(fused.depth - drawn.depth)
    assert np.median(error_m[ahead]) < 0.02
    assert np.median(error_m[cut]) < 0.02
    assert np.isfinite(fused.depth).all()

    far = make(drawn, "fused", np.where(cut, 10.0 * drawn.depth, drawn.depth)).depth
    assert np.all(far.depth <= far.at_most)
    assert far.depth[cut].max() < 2.5


@pytest.mark.parametrize(
    ("changes", "word"),
    [
        ({"image": np.zeros((90, 160, 3), dtype=np.uint8)}, "black"),
        ({"height_above_ground_m": 0.0}, "no height"),
        ({"height_above_ground_m": -0.2}, "no height"),
        ({"height_above_ground_m": math.nan}, "telemetry"),
        ({"gimbal_pitch_rad": math.nan}, "telemetry"),
        ({"captured_s": 9.0}, "class map is of another frame"),
    ],
)
@pytest.mark.parametrize("source", ["network", "contact", "fused"])
def test_a_bad_frame_is_refused_by_name(
    drawn: View, source: str, changes: dict[str, Any], word: str
) -> None:
    made = make(drawn, source, drawn.depth, changes=changes)
    assert made.depth is None
    assert word in made.refusal


@pytest.mark.parametrize("source", ["network", "fused"])
def test_a_network_that_says_nothing_usable_is_refused_by_name(drawn: View, source: str) -> None:
    holed = drawn.depth.copy()
    holed[3, 4] = np.nan
    for made, words in (
        (make(drawn, source, holed), "not finite"),
        (make(drawn, source), "no relative depth"),
        (make(drawn, source, drawn.depth, network_s=2.0), "no relative depth"),
    ):
        assert made.depth is None
        assert words in made.refusal


def test_without_a_scale_contact_remains(drawn: View) -> None:
    """The pad's top needs no ground: its height is known."""
    ids = np.where(drawn.ids == CARPET, BACKGROUND, drawn.ids).astype(np.uint8)
    ids[60:70, 100:120] = HELIPAD_H
    network, fused = (make(drawn, each, drawn.depth, ids=ids) for each in ("network", "fused"))
    assert network.depth is None
    assert network.refusal == fused.refusal == "no scale: too little ground"
    assert np.isfinite(fused.depth.depth).sum() == 200


def test_a_map_of_nothing_is_no_depth(drawn: View) -> None:
    """It would read as a free way."""
    for source, word in (("contact", "nothing in view stands"), ("fused", "no scale")):
        made = make(drawn, source, drawn.depth, ids=np.zeros((112, 224), dtype=np.uint8))
        assert made.depth is None
        assert word in made.refusal


def test_a_further_measure_limits_ground_and_depth_but_not_the_scale(drawn: View) -> None:
    made = make(drawn, "network", drawn.depth)
    found = made.limited("flow", (0.2, "the ground passes too fast"))
    assert found.depth.confidence == 0.2
    assert found.confidences["scale"] == made.confidences["scale"]
    for name in ("ground", "depth"):
        assert found.confidences[name].reason == "the ground passes too fast"
    assert "flow" in found.confidences["ground"].measures


def test_remembered_obstacles_are_placed_from_the_lens_at_the_frames_capture(drawn: View) -> None:
    """Half a second ago the drone was a quarter metre behind and looked a quarter turn left."""
    then = Pose2D(x_m=0.0, y_m=0.0, yaw_rad=0.0)
    now = Pose2D(x_m=0.0, y_m=0.25, yaw_rad=math.pi / 2)
    points = NearObstacles(points_m=np.array([[1.0, 0.0]]), captured_s=3.5)
    seen = remembered_bases(points, now, then, values.frame(drawn.image), CAMERA)

    # 1.25 m to the right of where it was, and the lens ahead of its centre.
    ahead = -CAMERA.forward_offset_m
    assert seen.range_m == pytest.approx([math.hypot(ahead, 1.25)])
    assert seen.azimuth_rad == pytest.approx([math.atan2(1.25, ahead)])


def test_contact_uses_what_is_remembered_at_the_frames_pose(drawn: View) -> None:
    """The box on the left is cut off; its outline was seen before."""
    for seen_s, is_known in ((3.0, True), (2.9, False)):
        edge = np.linspace(-0.15, 0.15, 7)
        rim = [
            np.stack([np.full(7, 0.55), edge - 0.45], 1),
            np.stack([edge + 0.7, np.full(7, -0.3)], 1),
        ]
        points = NearObstacles(points_m=np.concatenate(rim) + np.array([0.15, 0.0]), captured_s=3.0)
        here = values.motion(OdometryPose(x_m=0.0, y_m=0.0, yaw_rad=0.0, time_s=seen_s))
        found = make(drawn, "contact", near=points, motion=here).depth
        error_m = np.abs(found.depth - drawn.depth)[drawn.ids == BOXES[1]]
        assert (np.isfinite(error_m).mean() > 0.9) == is_known
        if is_known:
            assert np.nanmedian(error_m) < 0.03
