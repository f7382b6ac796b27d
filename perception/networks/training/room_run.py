"""Training of the network with two heads on images of rooms.

Roles have a cross-entropy. Depth has the absolute error of its logarithm, with and without the
median offset of each image (Eigen et al., arXiv 1406.2283), and the error of its steps between
neighbours, which keeps edges sharp (Li and Snavely, arXiv 1804.00607).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional

from perception.networks.training.loop import (
    LoopConfig,
    Progress,
    channels_last,
    ignore_progress,
    train,
)
from perception.networks.training.room_augment import RoomAugmentation, augment_rooms
from perception.networks.training.room_net import RoomNet
from perception.segmentation.training.run import IGNORED
from perception.segmentation.training.unet import UNetConfig

ROOM_SHAPE: Final = UNetConfig(outputs=3, channels=(24, 48, 96, 192), context=True)
_NEAREST, _FARTHEST = 0.05, 12.0  # depth that is learned, in heights of the camera


@dataclass(frozen=True, kw_only=True)
class RoomTrainingConfig(LoopConfig):
    """Settings of a run.

    Attributes:
        depth: Weight of the depth's loss beside the roles'.
        edges: Weight of the steps between neighbours within it.
        augment: Strengths of the random changes.
    """

    batch: int = 32
    depth: float = 0.7
    edges: float = 0.5
    augment: RoomAugmentation = field(default_factory=RoomAugmentation)


@dataclass(frozen=True, kw_only=True, eq=False)
class RoomImages:
    """Images of rooms with roles and depth, at the network's size.

    Attributes:
        rgb: (N, H, W, 3) uint8.
        roles: (N, H, W) uint8; 0 outside, 1 ground, 2 obstacle, 255 without a label.
        depth: (N, H, W) float16, along the optical axis, in heights of the camera.
    """

    rgb: NDArray[np.uint8]
    roles: NDArray[np.uint8]
    depth: NDArray[np.float16]


def train_room_net(
    images: RoomImages,
    config: RoomTrainingConfig,
    *,
    start: RoomNet | None = None,
    checkpoint: Path | None = None,
    progress: Callable[[Progress, RoomNet], None] = ignore_progress,
) -> RoomNet:
    """Train the network, or continue from the checkpoint if there is one.

    Args:
        images: the training set.
        config: how to train.
        start: network whose weights it begins with; None: random ones.
        checkpoint: file of the run's state; read first if it exists.
        progress: called after every step with the averaged network.

    Returns:
        The network with the running mean of its weights, in evaluation mode.

    Raises:
        WeightsError: the checkpoint is damaged or belongs to another run.
        ValueRangeError: the loss has become NaN or infinite.
    """
    torch.manual_seed(config.seed)
    net = channels_last(RoomNet(ROOM_SHAPE) if start is None else start)
    arrays: tuple[NDArray[Any], ...] = (images.rgb, images.roles, images.depth)
    stored = [torch.from_numpy(each).to(config.device) for each in arrays]

    def objective(rng: np.random.Generator) -> tuple[Tensor, Mapping[str, Tensor]]:
        generator = torch.Generator(config.device).manual_seed(int(rng.integers(2**62)))
        chosen = torch.from_numpy(rng.integers(0, len(images.rgb), config.batch)).to(config.device)
        rgb, roles, depth = (each[chosen] for each in stored)
        labels = torch.stack([roles.float(), depth.float()], dim=1)
        pixels, labels = augment_rooms(
            rgb.permute(0, 3, 1, 2).float() / 255.0, labels, generator, config.augment
        )
        features = net.trunk.features(pixels.contiguous(memory_format=torch.channels_last))
        logits = net.trunk.spread(net.trunk.head(features))
        known = labels[:, 0].round().long()
        terms = {
            "roles": functional.cross_entropy(logits, known, ignore_index=IGNORED),
            "depth": depth_loss(net.log_depth(features), labels[:, 1:], config.edges),
        }
        return terms["roles"] + config.depth * terms["depth"], terms

    return train(
        net,
        objective,
        config,
        kind="room-checkpoint",
        about={"training": asdict(config), "net": asdict(ROOM_SHAPE)},
        checkpoint=checkpoint,
        progress=progress,
    )


def depth_loss(log_depth: Tensor, truth: Tensor, edges: float) -> Tensor:
    """Return the error of depth.

    Args:
        log_depth: (N, 1, h, w) logarithm of the prediction.
        truth: (N, 1, H, W) depth in heights of the camera.
        edges: weight of the steps between neighbours.
    """
    size = log_depth.shape[-2:]
    truth = functional.interpolate(truth, size, mode="nearest")
    known = ((truth > _NEAREST) & (truth < _FARTHEST)).float()
    error = (log_depth - torch.log(truth.clamp(_NEAREST, _FARTHEST))) * known
    count = known.sum(dim=(1, 2, 3)).clamp(min=1.0)
    offset = (error.sum(dim=(1, 2, 3)) / count).view(-1, 1, 1, 1)
    shape = (error - offset).abs() * known
    steps = [
        (error[..., 1:, :] - error[..., :-1, :]).abs() * known[..., 1:, :] * known[..., :-1, :],
        (error[..., 1:] - error[..., :-1]).abs() * known[..., 1:] * known[..., :-1],
    ]
    total = known.sum().clamp(min=1.0)
    whole = 0.5 * error.abs().sum() + shape.sum() + edges * sum(each.sum() for each in steps)
    return whole / total
