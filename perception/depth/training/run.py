"""Train the depth network on flights; a run can be broken off and resumed to the same result.

Three teachers, alone or together, none of which needs the true depth: the neighbouring frames
(through telemetry or a pose network), labels that masks and geometry give
(`perception.depth.contact.depth`), and smoothness. Exact depth, where a simulator has it, is only a
kind of labels: the upper bound to compare with.

Importing this module imports torch.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray

from perception.depth.training.clips import ClipSource
from perception.depth.training.config import DepthTrainingConfig
from perception.depth.training.learner import Batch, Learner
from perception.depth.training.network import DepthNet, DepthNetConfig
from uav_bt.errors import ValueRangeError

__all__ = ["DepthProgress", "DepthTrainingConfig", "predict_depth", "train_depth"]


@dataclass(frozen=True, kw_only=True)
class DepthProgress:
    """What a training run tells after a step."""

    step: int  # steps done
    steps: int  # steps in all
    loss: float
    terms: Mapping[str, float]  # unweighted, by name


# --- the run --------------------------------------------------------------------------------------


def train_depth(
    clips: ClipSource,
    config: DepthTrainingConfig,
    net_config: DepthNetConfig,
    *,
    start: Path | None = None,
    checkpoint: Path | None = None,
    progress: Callable[[DepthProgress, DepthNet], None] = lambda _now, _net: None,
) -> DepthNet:
    """Train, or go on from the checkpoint if there is one.

    Args:
        clips: what to learn from.
        config: how to train.
        net_config: the network's shape.
        start: weights to begin with, made by `export.save_depth_net`; None for random ones.
        checkpoint: where to keep the state; read first when it exists.
        progress: called after every step, with the running mean of the network.

    Returns:
        The network with the running mean of its weights, in evaluation mode.

    Raises:
        WeightsError: the checkpoint is damaged or belongs to another run, or the weights to begin
            with belong to another network.
        ValueRangeError: the loss is no longer finite, nothing teaches, or the flights' frames are
            not of the network's size.
    """
    if not config.compares_frames and not (clips.labelled and config.labels > 0.0):
        raise ValueRangeError(
            "without comparing frames only labels teach, and these flights have none"
        )
    if clips.size_px != (net_config.width_px, net_config.height_px):
        width, height = clips.size_px
        raise ValueRangeError(
            f"the network takes {net_config.width_px}x{net_config.height_px} pictures, the "
            f"flights' are {width}x{height}"
        )
    torch.manual_seed(config.seed)
    run = Learner(config, net_config)
    if checkpoint is not None and checkpoint.is_file():
        run.step = run.checkpoint.load(checkpoint)
    elif start is not None:
        run.begin_with(start)
    while run.step < config.steps:
        # Drawn from seed and step alone: a resumed run sees what an unbroken one would have seen.
        rng = np.random.default_rng((config.seed, run.step))
        draw = clips.draw if config.compares_frames else clips.draw_frames
        loss, terms = run.learn(Batch([draw(rng) for _ in range(config.batch)]))
        if not math.isfinite(loss):
            raise ValueRangeError(
                f"the loss is {loss} after {run.step} steps; lower the learning rate"
            )
        if checkpoint is not None and (
            run.step % config.checkpoint_every == 0 or run.step == config.steps
        ):
            run.checkpoint.save(checkpoint, run.step)
        now = DepthProgress(step=run.step, steps=config.steps, loss=loss, terms=terms)
        run.mean.eval()
        progress(now, run.mean)
    run.mean.eval()
    return run.mean


def predict_depth(net: DepthNet, rgb: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Return the depth, (N, H/2, W/2), of pictures, (N, H, W, 3), at the network's size."""
    planes = torch.from_numpy(np.ascontiguousarray(rgb.transpose(0, 3, 1, 2))).float().div_(255.0)
    with torch.inference_mode():
        depth = net(planes.contiguous(memory_format=torch.channels_last))
    return np.asarray(depth[:, 0].numpy(), dtype=np.float32)
