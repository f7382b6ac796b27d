"""Tests for the training of the network with two heads."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from perception.networks.training.room_augment import RoomAugmentation, augment_rooms
from perception.networks.training.room_run import (
    RoomImages,
    RoomTrainingConfig,
    depth_loss,
    train_room_net,
)
from perception.segmentation.training.run import IGNORED

NOTHING = RoomAugmentation(
    zoom=1.0, gain=0.0, tint=0.0, gamma=0.0, shading=0.0, hue_rad=0.0, noise=0.0, blurred=0.0
)


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
    generator = torch.Generator().manual_seed(2)
    config = RoomAugmentation(**{**vars(NOTHING), "zoom": 1.4})
    rgb, labels = augment_rooms(ramp, ramp[:, :1].clone(), generator, config)
    # Saturation leaves grey images alone, so that the image is still its label.
    torch.testing.assert_close(rgb[:, :1], labels, atol=0.01, rtol=0.0)
    slopes = (labels[:, 0, 50, -1] - labels[:, 0, 50, 0]).abs()
    assert (slopes < 0.8).all()
    assert {bool(each > 0) for each in labels[:, 0, 50, -1] - labels[:, 0, 50, 0]} == {True, False}


def test_images_stay_in_range_under_every_change() -> None:
    rgb = torch.rand(8, 3, 112, 224, generator=torch.Generator().manual_seed(3))
    changed, _ = augment_rooms(
        rgb, rgb[:, :1], torch.Generator().manual_seed(4), RoomAugmentation()
    )
    assert changed.isfinite().all()
    assert changed.min() >= 0.0
    assert changed.max() <= 1.0
    assert (changed - rgb).abs().mean() > 0.05


def test_a_common_factor_costs_less_than_a_wrong_shape() -> None:
    truth = torch.linspace(1.0, 4.0, 56 * 112).view(1, 1, 56, 112)
    right = torch.log(truth)
    factor = depth_loss(right + 0.2, truth, 0.5)
    shape = depth_loss(right + 0.2 * torch.sign(torch.sin(50 * truth)), truth, 0.5)
    assert depth_loss(right, truth, 0.5) == pytest.approx(0.0, abs=1e-6)
    assert 0.0 < factor < shape
    unknown = torch.full_like(truth, 60.0)
    assert depth_loss(right, unknown, 0.5) == 0.0


def test_training_learns_roles_and_depth() -> None:
    images = striped(8)
    losses: list[float] = []
    net = train_room_net(
        images,
        RoomTrainingConfig(steps=25, batch=4, warm_up_steps=3, average=0.5, augment=NOTHING),
        progress=lambda now, _net: losses.append(now.loss),
    )
    assert np.mean(losses[-5:]) < 0.5 * np.mean(losses[:3])
    assert (net.predict_roles(images.rgb[0])[8:] == images.roles[0][8:]).mean() > 0.9
