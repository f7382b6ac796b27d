"""Tests for the network with two heads in flight."""

from __future__ import annotations

import hashlib
from pathlib import Path

import cv2
import numpy as np
import onnx
import pytest

from perception.depth.runtime import load_depth_estimator
from perception.networks.training.room_net import ROOM_FILES
from perception.networks.weights_file import SHIPPED_WEIGHTS
from perception.segmentation.room_runtime import RoomSegmenter
from perception.segmentation.runtime import OnnxSegmenter, load_segmenter
from tests.paper_lab import CLASSES
from uav_bt.errors import WeightsError
from uav_bt.lab.classes import GROUND, OBSTACLE, OUTSIDE
from uav_bt.lab.shipped import load_lab
from uav_bt.learning.views import DepthViewPlan, DepthViews, depth_views
from uav_bt.types import Frame

ANY = SHIPPED_WEIGHTS / "any.onnx"
WEIGHTS = SHIPPED_WEIGHTS / "any.safetensors"


def _frame(rgb: np.ndarray, captured_s: float = 2.5) -> Frame:
    return Frame(image=rgb, index=1, captured_s=captured_s, gimbal_pitch_rad=-0.5)


@pytest.fixture(scope="module")
def depot() -> DepthViews:
    return depth_views(DepthViewPlan(scenes=("depot-val-a",), views=6))


def test_ground_of_a_room_without_labels_is_found(depot: DepthViews) -> None:
    classes = load_lab("depot").classes
    segmenter = load_segmenter(ANY, classes)
    assert isinstance(segmenter, RoomSegmenter)
    found = truth = both = 0
    for rgb, ids in zip(depot.rgb, depot.ids, strict=True):
        roles = segmenter.segment(_frame(rgb)).roles
        ground = cv2.resize(classes.roles(ids), segmenter.size_px, interpolation=0) == GROUND
        found, truth = found + (roles == GROUND).sum(), truth + ground.sum()
        both += ((roles == GROUND) & ground).sum()
    assert both / truth > 0.85
    assert both / found > 0.85


def test_depth_belongs_to_the_frame_and_is_in_heights(depot: DepthViews) -> None:
    classes = load_lab("depot").classes
    segmenter = RoomSegmenter(ANY, classes)
    assert segmenter.relative_depth is None
    for index, rgb in enumerate(depot.rgb):
        segmenter.segment(_frame(rgb, captured_s=float(index)))
        depth = segmenter.relative_depth
        assert depth is not None
        assert (depth.captured_s, depth.metric) == (index, False)
        ground = classes.roles(depot.ids[index]) == GROUND
        size = (depot.ids.shape[2], depot.ids.shape[1])
        predicted = cv2.resize(depth.depth, size, interpolation=cv2.INTER_LINEAR)
        ratio = np.median(depot.depth_m[index][ground] / predicted[ground])
        assert 0.7 < ratio < 2.2, "the cameras are 0.9 to 1.7 m high"


def test_roles_become_the_first_classes_of_a_lab() -> None:
    picture = np.random.default_rng(0).integers(0, 255, (112, 224, 3), dtype=np.uint8)
    ids = set(np.unique(RoomSegmenter(ANY, CLASSES).segment(_frame(picture)).ids).tolist())
    assert ids <= {CLASSES.of_role(OUTSIDE)[0], CLASSES.ground, CLASSES.of_role(OBSTACLE)[0]}


def test_the_second_head_is_a_depth_network(depot: DepthViews) -> None:
    segmenter = RoomSegmenter(ANY, CLASSES)
    segmenter.segment(_frame(depot.rgb[0]))
    alone = load_depth_estimator("any").estimate(_frame(depot.rgb[0]))
    assert segmenter.relative_depth is not None
    np.testing.assert_array_equal(alone.depth, segmenter.relative_depth.depth)


def test_other_networks_are_segmenters_of_classes(tmp_path: Path) -> None:
    unet = SHIPPED_WEIGHTS / "unet.onnx"
    assert isinstance(load_segmenter(unet, CLASSES), OnnxSegmenter)
    with pytest.raises(WeightsError, match="expected the outputs logits and depth"):
        RoomSegmenter(unet, CLASSES)
    with pytest.raises(WeightsError, match="no such network"):
        load_segmenter(tmp_path / "absent.onnx", CLASSES)


def test_the_shipped_file_was_made_from_the_shipped_weights(depot: DepthViews) -> None:
    properties = {each.key: each.value for each in onnx.load(ANY).metadata_props}
    assert properties["weights_sha256"] == hashlib.sha256(WEIGHTS.read_bytes()).hexdigest()
    net, _ = ROOM_FILES.load(WEIGHTS)
    size = (net.config.width_px, net.config.height_px)
    flies = RoomSegmenter(ANY, load_lab("depot").classes)
    same = []
    for rgb in depot.rgb:
        small = cv2.resize(rgb, size, interpolation=cv2.INTER_AREA)
        roles = net.predict_roles(small)
        table = np.array([OUTSIDE, GROUND, OBSTACLE])
        same.append((table[roles] == flies.segment(_frame(small)).roles).mean())
    assert np.mean(same) > 0.97
