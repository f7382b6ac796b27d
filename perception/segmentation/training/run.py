"""Train the U-Net on labelled pictures; a run can be broken off and resumed to the same result.

Importing this module imports torch.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Final, Literal

import cv2
import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from perception.networks.checkpoint import Checkpoint
from perception.networks.torch_state import (
    channels_last,
    follow_mean,
    warm_cosine,
)
from perception.segmentation.training.augment import AugmentConfig, augmented
from perception.segmentation.training.losses import LOSSES
from perception.segmentation.training.unet import UNet, UNetConfig
from uav_bt.classes import CLASS_COUNT
from uav_bt.errors import ShapeError, UnknownNameError, ValueRangeError

__all__ = [
    "IGNORED",
    "LabelledPictures",
    "Progress",
    "TrainingConfig",
    "collect_pictures",
    "predict",
    "train_unet",
]

IGNORED: Final = 255  # a label that says nothing: the pixel does not enter the loss
_KIND: Final = "unet-checkpoint"


@dataclass(frozen=True, kw_only=True)
class TrainingConfig:
    """How the U-Net is trained."""

    steps: int = 4000
    batch: int = 12  # pictures a step
    learning_rate: float = 3e-3  # peak; AdamW
    weight_decay: float = 1e-4
    warm_up_steps: int = 100  # linear rise, then half a cosine down to nothing
    loss: Literal["cross_entropy", "bce_dice"] = "cross_entropy"  # the paper's best comes first
    average: float = 0.99  # decay of the running mean of the weights, which is what is kept
    augment: AugmentConfig = field(default_factory=AugmentConfig)
    seed: int = 0  # of the first weights, the order of the pictures and their changes
    checkpoint_every: int = 200  # steps

    def __post_init__(self) -> None:
        if min(self.steps, self.batch, self.checkpoint_every) < 1 or self.learning_rate <= 0.0:
            raise ValueRangeError(
                "steps, batch, checkpoint_every and learning_rate must be positive, got "
                f"{self.steps}, {self.batch}, {self.checkpoint_every}, {self.learning_rate}"
            )
        if not 0.0 <= self.average < 1.0:
            raise ValueRangeError(f"average must lie within 0 and 1, got {self.average}")
        if self.loss not in LOSSES:
            raise UnknownNameError("loss", self.loss, LOSSES)


@dataclass(frozen=True, kw_only=True)
class Progress:
    """What a training run tells after a step."""

    step: int  # steps done
    steps: int  # steps in all
    loss: float


@dataclass(frozen=True, kw_only=True, eq=False)
class LabelledPictures:
    """A training set in memory, at the network's size."""

    rgb: NDArray[np.uint8]  # (N, H, W, 3)
    ids: NDArray[np.uint8]  # (N, H, W); `IGNORED` where nobody knows

    def __post_init__(self) -> None:
        if self.rgb.ndim != 4 or self.rgb.shape[3] != 3 or not len(self.rgb):
            raise ShapeError("pictures", expected="NxHxWx3, N > 0", actual=self.rgb.shape)
        if self.ids.shape != self.rgb.shape[:3]:
            expected = "x".join(map(str, self.rgb.shape[:3]))
            raise ShapeError("labels", expected=expected, actual=self.ids.shape)
        used = np.unique(self.ids)
        if ((used >= CLASS_COUNT) & (used != IGNORED)).any():
            raise ValueRangeError(f"labels must lie within 0 and {CLASS_COUNT - 1} or be {IGNORED}")


def collect_pictures(
    samples: Iterable[tuple[NDArray[np.uint8], NDArray[np.uint8]]], config: UNetConfig
) -> LabelledPictures:
    """Resize samples to the network's size (area interpolation, nearest label) and keep them.

    Args:
        samples: (H, W, 3) RGB and (h, w) class ids, each of any size.
        config: the network, for its size.
    """
    size = (config.width_px, config.height_px)
    rgbs, maps = [], []
    for rgb, ids in samples:
        rgbs.append(cv2.resize(rgb, size, interpolation=cv2.INTER_AREA))
        maps.append(cv2.resize(ids, size, interpolation=cv2.INTER_NEAREST_EXACT))
    if not rgbs:
        raise ValueRangeError("cannot train on no pictures")
    return LabelledPictures(rgb=np.stack(rgbs), ids=np.stack(maps))


# --- the run --------------------------------------------------------------------------------------


def train_unet(
    pictures: LabelledPictures,
    config: TrainingConfig,
    net_config: UNetConfig,
    *,
    checkpoint: Path | None = None,
    progress: Callable[[Progress], None] = lambda _: None,
) -> UNet:
    """Train, or go on from the checkpoint if there is one.

    Args:
        pictures: at the network's size.
        config: how to train.
        net_config: the network's shape.
        checkpoint: where to keep the state; read first when it exists.
        progress: called after every step.

    Returns:
        The network with the running mean of its weights, in evaluation mode.

    Raises:
        WeightsError: the checkpoint is damaged or belongs to another run.
        ValueRangeError: the loss is no longer finite.
    """
    torch.manual_seed(config.seed)
    run = _Run(config, net_config)
    if checkpoint is not None and checkpoint.is_file():
        run.step = run.checkpoint.load(checkpoint)
    while run.step < config.steps:
        # Drawn from seed and step alone: a resumed run sees what an unbroken one would have seen.
        rng = np.random.default_rng((config.seed, run.step))
        loss = run.learn(*_batch(pictures, rng, config))
        if not math.isfinite(loss):
            raise ValueRangeError(
                f"the loss is {loss} after {run.step} steps; lower the learning rate"
            )
        if checkpoint is not None and (
            run.step % config.checkpoint_every == 0 or run.step == config.steps
        ):
            run.checkpoint.save(checkpoint, run.step)
        progress(Progress(step=run.step, steps=config.steps, loss=loss))
    run.mean.eval()
    return run.mean


def predict(net: UNet, rgb: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return the class ids, (N, H, W), of pictures, (N, H, W, 3), at the network's size."""
    with torch.inference_mode():
        logits = net(_to_input(rgb))
    return np.asarray(logits.argmax(dim=1).to(torch.uint8).numpy(), dtype=np.uint8)


def _to_input(rgb: NDArray[np.uint8]) -> Tensor:
    batch = torch.from_numpy(rgb).permute(0, 3, 1, 2).float().div_(255.0)
    return batch.contiguous(memory_format=torch.channels_last)


def _batch(
    pictures: LabelledPictures, rng: np.random.Generator, config: TrainingConfig
) -> tuple[Tensor, Tensor]:
    chosen = rng.integers(len(pictures.rgb), size=config.batch)
    pairs = [augmented(pictures.rgb[i], pictures.ids[i], rng, config.augment) for i in chosen]
    rgb = np.stack([pair[0] for pair in pairs])
    ids = np.stack([pair[1] for pair in pairs])
    return _to_input(rgb), torch.from_numpy(ids.astype(np.int64))


class _Run:
    """The state of a training run: network, its running mean, optimiser and step."""

    def __init__(self, config: TrainingConfig, net_config: UNetConfig) -> None:
        self.config = config
        self.step = 0
        self.net = channels_last(UNet(net_config))
        self.mean = channels_last(UNet(net_config))
        self.mean.load_state_dict(self.net.state_dict())
        self.loss = LOSSES[config.loss]
        self.optimiser = torch.optim.AdamW(
            self.net.parameters(), lr=config.learning_rate, weight_decay=config.weight_decay
        )
        about = {"training": asdict(config), "net": asdict(net_config)}
        self.checkpoint = Checkpoint(
            kind=_KIND,
            about=json.dumps(about, sort_keys=True),
            modules={"net": self.net, "mean": self.mean},
            optimiser=self.optimiser,
        )

    def learn(self, rgb: Tensor, ids: Tensor) -> float:
        """Do one step; return its loss."""
        rate = self.config.learning_rate * warm_cosine(
            self.step, warm_up=self.config.warm_up_steps, steps=self.config.steps
        )
        for group in self.optimiser.param_groups:
            group["lr"] = rate
        self.net.train()
        loss = self.loss(self.net(rgb), ids, IGNORED)
        self.optimiser.zero_grad(set_to_none=True)
        torch.autograd.backward(loss)
        nn.utils.clip_grad_norm_(self.net.parameters(), 5.0)
        self.optimiser.step()
        self.step += 1
        follow_mean(self.mean, self.net, most=self.config.average, step=self.step)
        return float(loss.detach())
