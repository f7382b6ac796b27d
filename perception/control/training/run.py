"""Train the control student on windows of flights. Importing this module imports torch."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from perception.control.config import ControlNetConfig
from perception.control.runtime import ControlEstimate, decode
from perception.control.training.augment import ControlAugmentConfig, augmented
from perception.control.training.losses import choice_loss
from perception.control.training.network import ControlNet
from perception.control.training.samples import Batch, ControlSamples, SampleConfig
from perception.networks.training.loop import (
    LoopConfig,
    Progress,
    channels_last,
    ignore_progress,
    train,
)
from uav_bt.errors import ValueRangeError


@dataclass(frozen=True, kw_only=True)
class ControlTrainingConfig(LoopConfig):
    """How the control student is trained."""

    steps: int = 6000
    batch: int = 24  # windows a step
    learning_rate: float = 2e-3  # peak; AdamW
    weight_decay: float = 1e-3
    warm_up_steps: int = 200
    dropout: float = 0.2  # of each view's embedding: no single value may decide
    average: float = 0.995
    samples: SampleConfig = field(default_factory=SampleConfig)
    augment: ControlAugmentConfig = field(default_factory=ControlAugmentConfig)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0.0 <= self.dropout < 1.0:
            raise ValueRangeError(f"dropout must lie within 0 and 1, got {self.dropout}")


def train_control(
    samples: ControlSamples,
    config: ControlTrainingConfig,
    net_config: ControlNetConfig,
    *,
    start: Mapping[str, NDArray[np.float32]] | None = None,
    checkpoint: Path | None = None,
    progress: Callable[[Progress, ControlNet], None] = ignore_progress,
) -> ControlNet:
    """Train, or go on from the checkpoint if there is one.

    Args:
        samples: what to learn from, of the network's size.
        config: how to train.
        net_config: the network's shape.
        start: weights by name to begin with; layers that it lacks, or has in another shape, begin
            at random.
        checkpoint: where to keep the state; read first when it exists.
        progress: called after every step with the averaged network.

    Returns:
        The network with the running mean of its weights, in evaluation mode.

    Raises:
        WeightsError: the checkpoint is damaged or belongs to another run.
        ValueRangeError: the loss is no longer finite.
    """
    torch.manual_seed(config.seed)
    net = channels_last(ControlNet(net_config, dropout=config.dropout))
    _begin_with(net, start or {})

    def objective(rng: np.random.Generator) -> tuple[Tensor, Mapping[str, Tensor]]:
        torch.manual_seed(int(rng.integers(2**31)))  # of the dropout
        batch = augmented(samples.draw(rng, config.batch), rng, config.augment)
        prediction = net(_planes(batch.frames), torch.from_numpy(batch.state))
        labels, turning = torch.from_numpy(batch.labels), torch.from_numpy(batch.turning)
        return choice_loss(prediction, labels, turning), {}

    return train(
        net,
        objective,
        config,
        kind="control-checkpoint",
        about={
            "training": asdict(config),
            "net": net_config.to_json(),
            "windows": len(samples),
        },
        checkpoint=checkpoint,
        progress=progress,
    )


def predict_control(net: ControlNet, batch: Batch) -> list[ControlEstimate]:
    """Return the network's estimates for the windows of a batch."""
    net.eval()
    with torch.inference_mode():
        predictions: Tensor = net(_planes(batch.frames), torch.from_numpy(batch.state))
    return [decode(prediction) for prediction in predictions.numpy()]


def _planes(frames: NDArray[np.uint8]) -> Tensor:
    return torch.from_numpy(frames).permute(0, 1, 4, 2, 3).float().div_(255.0)


@torch.no_grad()
def _begin_with(net: ControlNet, start: Mapping[str, NDArray[np.float32]]) -> None:
    for name, value in net.state_dict().items():
        given = start.get(name)
        if given is not None and given.shape == tuple(value.shape):
            value.copy_(torch.from_numpy(np.array(given)))
