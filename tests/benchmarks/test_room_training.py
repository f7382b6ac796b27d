"""Tests for the training of the network for any room, and for its shipped files."""

from __future__ import annotations

import hashlib

import cv2
import numpy as np
import onnx
import pytest
import torch

from benchmarks.rooms.network import ROOM_FILES
from benchmarks.rooms.training import RoomImages, augment_rooms, depth_loss, train_room_net, zoomed
from benchmarks.rooms.views import role_numbers
from perception.networks.training.loop import LoopConfig
from perception.networks.weights_file import SHIPPED_WEIGHTS
from perception.segmentation.runtime import RoomSegmenter
from perception.segmentation.training.run import IGNORED
from uav_bt.lab.shipped import load_lab
from uav_bt.learning.views import ViewPlan, twin_views
from uav_bt.types import Frame


def striped(count: int) -> RoomImages:
    """Return images whose lower half is ground; depth falls from the middle to the lower edge."""
    rng = np.random.default_rng(1)
    rgb = rng.integers(0, 40, (count, 112, 224, 3), dtype=np.uint8)
    rgb[:, 56:, :, 1] += 180
    roles = np.zeros((count, 112, 224), np.uint8)
    roles[:, 56:] = 1
    roles[:, :4] = IGNORED
    depth = np.full((count, 112, 224), 4.0, np.float16)
    depth[:, 56:] = np.linspace(4.0, 1.0, 56)[:, None]
    return RoomImages(rgb=rgb, roles=roles, depth=depth)


def test_labels_follow_the_geometry_of_their_image() -> None:
    ramp = torch.linspace(0.1, 0.9, 224).repeat(6, 3, 112, 1)
    rgb, labels = zoomed(ramp, ramp[:, :1].clone(), torch.Generator().manual_seed(2))
    torch.testing.assert_close(rgb[:, :1], labels, atol=0.01, rtol=0.0)
    slopes = labels[:, 0, 50, -1] - labels[:, 0, 50, 0]
    assert (slopes.abs() < 0.8).all()
    assert {bool(each > 0) for each in slopes} == {True, False}


def test_images_stay_in_range_under_every_change() -> None:
    rgb = torch.rand(8, 3, 112, 224, generator=torch.Generator().manual_seed(3))
    changed, _ = augment_rooms(rgb, rgb[:, :1], torch.Generator().manual_seed(4))
    assert changed.isfinite().all()
    assert 0.0 <= changed.min() <= changed.max() <= 1.0
    assert (changed - rgb).abs().mean() > 0.05


def test_a_common_factor_costs_less_than_a_wrong_shape() -> None:
    truth = torch.linspace(1.0, 4.0, 56 * 112).view(1, 1, 56, 112)
    right = torch.log(truth)
    factor = depth_loss(right + 0.2, truth)
    shape = depth_loss(right + 0.2 * torch.sign(torch.sin(50 * truth)), truth)
    assert depth_loss(right, truth) == pytest.approx(0.0, abs=1e-6)
    assert 0.0 < factor < shape
    assert depth_loss(right, torch.full_like(truth, 60.0)) == 0.0


def test_training_learns_roles_and_depth() -> None:
    images, losses = striped(8), list[float]()
    net = train_room_net(
        images,
        LoopConfig(steps=25, batch=4, warm_up_steps=3, average=0.5),
        lambda rgb, labels, _: (rgb, labels),
        lambda now, _: losses.append(now.loss),
    )
    assert np.mean(losses[-5:]) < 0.5 * np.mean(losses[:3])
    assert (net.predict_roles(images.rgb[0])[8:] == images.roles[0][8:]).mean() > 0.9


def test_the_shipped_file_was_made_from_the_shipped_weights() -> None:
    file, weights = SHIPPED_WEIGHTS / "any.onnx", SHIPPED_WEIGHTS / "any.safetensors"
    properties = {each.key: each.value for each in onnx.load(file).metadata_props}
    assert properties["weights_sha256"] == hashlib.sha256(weights.read_bytes()).hexdigest()
    net, _ = ROOM_FILES.load(weights)
    size = (net.config.width_px, net.config.height_px)
    flies = RoomSegmenter(file, load_lab("depot").classes)
    same = []
    plan = ViewPlan(scenes=("depot-val-a",), views=6, size_px=(640, 360))
    for _, rgb, _ in twin_views(plan):
        small = cv2.resize(rgb, size, interpolation=cv2.INTER_AREA)
        frame = Frame(image=small, index=1, captured_s=2.5, gimbal_pitch_rad=-0.5)
        roles = role_numbers(flies.segment(frame).roles)
        same.append((net.predict_roles(small) == roles).mean())
    assert np.mean(same) > 0.97
