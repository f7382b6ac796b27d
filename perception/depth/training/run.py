"""Training of the depth network on flights.

Three sources of supervision, alone or combined, need no true depth: neighbouring frames (through
telemetry or a pose network), labels from masks and geometry (`perception.depth.contact.depth`), and
smoothness.

Importing this module imports torch.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Final, Literal

import numpy as np
import torch
from torch import Tensor

from perception.depth.training.clips import ClipSource, varied
from perception.depth.training.losses import loss_terms
from perception.depth.training.network import DEPTH_FILES, DepthNet, DepthNetConfig, PoseNet
from perception.networks.training.loop import (
    LoopConfig,
    Progress,
    channels_last,
    ignore_progress,
    train,
)
from uav_bt.errors import WeightsError
from uav_bt.types.arrays import Floats32, Image

# SC-Depth's, and that of the labels.
_WEIGHTS: Final = {"photometric": 1.0, "geometry": 0.1, "smoothness": 0.1, "labels": 1.0}


@dataclass(frozen=True, kw_only=True)
class DepthTrainingConfig(LoopConfig):
    """How the depth network is trained."""

    steps: int = 2500
    batch: int = 4  # clips per step, of three frames each
    learning_rate: float = 1e-3  # peak; AdamW. SC-Depth's 1e-4 starts from a trained encoder
    max_norm: float = 1.0
    pose: Literal["telemetry", "network"] = "telemetry"  # source of the camera's motion
    photometric: bool = True  # compare neighbouring frames; False learns from labels alone
    checkpoint_every: int = 100  # steps


def train_depth(
    clips: ClipSource,
    config: DepthTrainingConfig,
    net_config: DepthNetConfig,
    *,
    start: Path | None = None,
    checkpoint: Path | None = None,
    progress: Callable[[Progress, DepthNet], None] = ignore_progress,
) -> DepthNet:
    """Return the network with the running mean of its weights, in evaluation mode.

    Args:
        clips: training data, of the network's size.
        config: how to train.
        net_config: the network's shape.
        start: initial weights, a file of `DEPTH_FILES`; None for random ones.
        checkpoint: file of the run's state, from which it continues if it exists.
        progress: called after every step with the averaged network.

    Raises:
        WeightsError: the checkpoint is damaged or belongs to another run, or the initial weights
            belong to another network.
        ValueRangeError: the loss has become NaN or infinite, or the camera does not move.
    """
    torch.manual_seed(config.seed)
    net = channels_last(DepthNet(net_config))
    pose = channels_last(PoseNet()) if config.pose == "network" else None
    if start is not None:
        trained, _ = DEPTH_FILES.load(start)
        try:
            net.load_state_dict(trained.state_dict())
        except RuntimeError as error:
            raise WeightsError(start, "belongs to a network of another shape") from error
    draw = clips.neighbours if config.photometric else clips.singles

    def objective(rng: np.random.Generator) -> tuple[Tensor, Mapping[str, Tensor]]:
        batch = [varied(draw(rng), rng) for _ in range(config.batch)]
        terms = loss_terms(batch, net, pose, compare=config.photometric, device=config.device)
        return torch.stack([_WEIGHTS[name] * term for name, term in terms.items()]).sum(), terms

    return train(
        net,
        objective,
        config,
        kind="depth-checkpoint",
        about={"training": asdict(config), "net": asdict(net_config)},
        beside=pose,
        checkpoint=checkpoint,
        progress=progress,
    )


def predict_depth(net: DepthNet, rgb: Image) -> Floats32:
    """Return the depth of images, (N, H, W, 3), along the optical axis, (N, H/2, W/2)."""
    planes = torch.from_numpy(np.ascontiguousarray(rgb.transpose(0, 3, 1, 2))).float().div_(255.0)
    planes = planes.to(next(net.parameters()).device, memory_format=torch.channels_last)
    with torch.inference_mode():
        depth = net(planes)
    return np.asarray(depth[:, 0].cpu().numpy(), dtype=np.float32)
