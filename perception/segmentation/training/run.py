"""Train the U-Net on labelled images. Importing this module imports torch."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Final, Literal

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from perception.networks.training.loop import (
    LoopConfig,
    Progress,
    channels_last,
    ignore_progress,
    train,
)
from perception.segmentation.training.augment import AugmentConfig, augmented
from perception.segmentation.training.losses import LOSSES
from perception.segmentation.training.unet import UNet, UNetConfig
from uav_bt.classes import CLASS_COUNT
from uav_bt.errors import ShapeError, UnknownNameError, ValueRangeError

IGNORED: Final = 255  # the label of an unknown pixel, which does not enter the loss


@dataclass(frozen=True, kw_only=True)
class TrainingConfig(LoopConfig):
    """How the U-Net is trained."""

    loss: Literal["cross_entropy", "bce_dice"] = "cross_entropy"  # the paper's best comes first
    augment: AugmentConfig = field(default_factory=AugmentConfig)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.loss not in LOSSES:
            raise UnknownNameError("loss", self.loss, LOSSES)


@dataclass(frozen=True, kw_only=True, eq=False)
class LabelledImages:
    """A training set in memory, at the network's size."""

    rgb: NDArray[np.uint8]  # (N, H, W, 3)
    ids: NDArray[np.uint8]  # (N, H, W); `IGNORED` where unknown

    def __post_init__(self) -> None:
        if self.rgb.ndim != 4 or self.rgb.shape[3] != 3 or not len(self.rgb):
            raise ShapeError("images", expected="NxHxWx3, N > 0", actual=self.rgb.shape)
        if self.ids.shape != self.rgb.shape[:3]:
            expected = "x".join(map(str, self.rgb.shape[:3]))
            raise ShapeError("labels", expected=expected, actual=self.ids.shape)
        used = np.unique(self.ids)
        if ((used >= CLASS_COUNT) & (used != IGNORED)).any():
            raise ValueRangeError(f"labels must lie within 0 and {CLASS_COUNT - 1} or be {IGNORED}")


def train_unet(
    images: LabelledImages,
    config: TrainingConfig,
    net_config: UNetConfig,
    *,
    checkpoint: Path | None = None,
    progress: Callable[[Progress, UNet], None] = ignore_progress,
) -> UNet:
    """Train, or go on from the checkpoint if there is one.

    Args:
        images: at the network's size.
        config: how to train.
        net_config: the network's shape.
        checkpoint: where to keep the state; read first when it exists.
        progress: called after every step with the averaged network.

    Returns:
        The network with the running mean of its weights, in evaluation mode.

    Raises:
        WeightsError: the checkpoint is damaged or belongs to another run.
        ValueRangeError: the loss is no longer finite.
    """
    torch.manual_seed(config.seed)
    net = channels_last(UNet(net_config))
    loss = LOSSES[config.loss]

    def objective(rng: np.random.Generator) -> tuple[Tensor, Mapping[str, Tensor]]:
        rgb, ids = _batch(images, rng, config)
        return loss(net(rgb), ids, IGNORED), {}

    return train(
        net,
        objective,
        config,
        kind="unet-checkpoint",
        about={"training": asdict(config), "net": asdict(net_config)},
        checkpoint=checkpoint,
        progress=progress,
    )


def predict(net: UNet, rgb: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return the class ids of images.

    Args:
        net: the network.
        rgb: (N, H, W, 3) uint8, at the network's size.

    Returns:
        (N, H, W) uint8.
    """
    with torch.inference_mode():
        logits = net(_to_input(rgb))
    return np.asarray(logits.argmax(dim=1).to(torch.uint8).numpy(), dtype=np.uint8)


def _to_input(rgb: NDArray[np.uint8]) -> Tensor:
    batch = torch.from_numpy(rgb).permute(0, 3, 1, 2).float().div_(255.0)
    return batch.contiguous(memory_format=torch.channels_last)


def _batch(
    images: LabelledImages, rng: np.random.Generator, config: TrainingConfig
) -> tuple[Tensor, Tensor]:
    chosen = rng.integers(len(images.rgb), size=config.batch)
    pairs = [augmented(images.rgb[i], images.ids[i], rng, config.augment) for i in chosen]
    rgb = np.stack([pair[0] for pair in pairs])
    ids = np.stack([pair[1] for pair in pairs])
    return _to_input(rgb), torch.from_numpy(ids.astype(np.int64))
