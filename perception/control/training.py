"""Train the control student; a run can be broken off and resumed to the same result.

Importing this module imports torch.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Final

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from perception.control.augment import ControlAugmentConfig, augmented
from perception.control.config import ControlNetConfig
from perception.control.losses import LOSSES
from perception.control.network import ControlNet
from perception.control.runtime import ControlEstimate, meaning
from perception.control.samples import Batch, ControlSamples, SampleConfig
from perception.networks.checkpoint import Checkpoint
from perception.networks.torch_state import (
    channels_last,
    follow_mean,
    warm_cosine,
)
from uav_bt.errors import ValueRangeError

__all__ = ["ControlProgress", "ControlTrainingConfig", "predict_control", "train_control"]

_KIND: Final = "control-checkpoint"


@dataclass(frozen=True, kw_only=True)
class ControlTrainingConfig:
    """How the control student is trained."""

    steps: int = 6000
    batch: int = 24  # windows a step
    learning_rate: float = 2e-3  # peak; AdamW
    weight_decay: float = 1e-3
    warm_up_steps: int = 200  # linear rise, then half a cosine down to nothing
    dropout: float = 0.2  # of each view's numbers: no single one may decide
    average: float = 0.995  # decay of the running mean of the weights, which is what is kept
    samples: SampleConfig = field(default_factory=SampleConfig)
    augment: ControlAugmentConfig = field(default_factory=ControlAugmentConfig)
    seed: int = 0  # of the first weights, the order of the windows and their changes
    checkpoint_every: int = 200  # steps

    def __post_init__(self) -> None:
        if min(self.steps, self.batch, self.checkpoint_every) < 1 or self.learning_rate <= 0.0:
            raise ValueRangeError(
                "steps, batch, checkpoint_every and learning_rate must be positive, got "
                f"{self.steps}, {self.batch}, {self.checkpoint_every}, {self.learning_rate}"
            )
        if not (0.0 <= self.average < 1.0 and 0.0 <= self.dropout < 1.0):
            raise ValueRangeError(
                f"average and dropout must lie within 0 and 1, got {self.average}, {self.dropout}"
            )


@dataclass(frozen=True, kw_only=True)
class ControlProgress:
    """What a run tells after a step."""

    step: int  # steps done
    steps: int  # steps in all
    loss: float


Told = Callable[[ControlProgress, ControlNet], None]


def _silent(_progress: ControlProgress, _net: ControlNet) -> None:
    """Tell nobody."""


def train_control(
    samples: ControlSamples,
    config: ControlTrainingConfig,
    net_config: ControlNetConfig,
    *,
    start: Mapping[str, NDArray[np.float32]] | None = None,
    checkpoint: Path | None = None,
    progress: Told = _silent,
) -> ControlNet:
    """Train, or go on from the checkpoint if there is one.

    Args:
        samples: what to learn from, of the network's size.
        config: how to train.
        net_config: the network's shape.
        start: weights by name to begin with; layers that it lacks, or has in another shape, begin
            at random.
        checkpoint: where to keep the state; read first when it exists.
        progress: called after every step, with the network of the running mean.

    Returns:
        The network with the running mean of its weights, in evaluation mode.

    Raises:
        WeightsError: the checkpoint is damaged or belongs to another run.
        ValueRangeError: the loss is no longer finite.
    """
    torch.manual_seed(config.seed)
    run = _Run(config, net_config, start or {}, len(samples))
    if checkpoint is not None and checkpoint.is_file():
        run.step = run.checkpoint.load(checkpoint)
    while run.step < config.steps:
        # Drawn from seed and step alone: a resumed run sees what an unbroken one would have seen.
        rng = np.random.default_rng((config.seed, run.step))
        torch.manual_seed(int(rng.integers(2**31)))
        batch = augmented(samples.draw(rng, config.batch), rng, config.augment)
        loss = run.learn(batch)
        if not math.isfinite(loss):
            raise ValueRangeError(
                f"the loss is {loss} after {run.step} steps; lower the learning rate"
            )
        if checkpoint is not None and (
            run.step % config.checkpoint_every == 0 or run.step == config.steps
        ):
            run.checkpoint.save(checkpoint, run.step)
        progress(ControlProgress(step=run.step, steps=config.steps, loss=loss), run.mean)
    return run.mean.eval()


def predict_control(net: ControlNet, batch: Batch) -> list[ControlEstimate]:
    """Return what the network says of windows."""
    net.eval()
    with torch.inference_mode():
        said: Tensor = net(_planes(batch.frames), torch.from_numpy(batch.situation))
    return [meaning(numbers, net.config) for numbers in said.numpy()]


def _planes(frames: NDArray[np.uint8]) -> Tensor:
    return torch.from_numpy(frames).permute(0, 1, 4, 2, 3).float().div_(255.0)


class _Run:
    """The state of a training run: network, its running mean, optimiser and step."""

    def __init__(
        self,
        config: ControlTrainingConfig,
        net_config: ControlNetConfig,
        start: Mapping[str, NDArray[np.float32]],
        windows: int,
    ) -> None:
        self.config = config
        self.step = 0
        self.net = channels_last(ControlNet(net_config, dropout=config.dropout))
        _begin_with(self.net, start)
        self.mean = channels_last(ControlNet(net_config))
        self.mean.load_state_dict(self.net.state_dict())
        self.loss = LOSSES[net_config.learns]
        self.optimiser = torch.optim.AdamW(
            self.net.parameters(), lr=config.learning_rate, weight_decay=config.weight_decay
        )
        about = {"training": asdict(config), "net": net_config.to_json(), "windows": windows}
        self.checkpoint = Checkpoint(
            kind=_KIND,
            about=json.dumps(about, sort_keys=True),
            modules={"net": self.net, "mean": self.mean},
            optimiser=self.optimiser,
        )

    def learn(self, batch: Batch) -> float:
        """Do one step; return its loss."""
        rate = self.config.learning_rate * warm_cosine(
            self.step, warm_up=self.config.warm_up_steps, steps=self.config.steps
        )
        for group in self.optimiser.param_groups:
            group["lr"] = rate
        self.net.train()
        said = self.net(_planes(batch.frames), torch.from_numpy(batch.situation))
        labels, turning = torch.from_numpy(batch.labels), torch.from_numpy(batch.turning)
        loss = self.loss(said, labels, turning)
        self.optimiser.zero_grad(set_to_none=True)
        torch.autograd.backward(loss)
        nn.utils.clip_grad_norm_(self.net.parameters(), 5.0)
        self.optimiser.step()
        self.step += 1
        follow_mean(self.mean, self.net, most=self.config.average, step=self.step)
        return float(loss.detach())


@torch.no_grad()
def _begin_with(net: ControlNet, start: Mapping[str, NDArray[np.float32]]) -> None:
    for name, value in net.state_dict().items():
        given = start.get(name)
        if given is not None and given.shape == tuple(value.shape):
            value.copy_(torch.from_numpy(np.array(given)))
