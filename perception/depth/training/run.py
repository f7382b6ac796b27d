"""Training of the depth network on flights, with the losses of SC-Depth and labels.

No source of supervision needs true depth. Telemetry or a pose network relates neighbouring frames.
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
from perception.networks.training import loop
from uav_bt.errors import WeightsError
from uav_bt.types.arrays import Floats32, Image

# SC-Depth's, and that of the labels.
_WEIGHTS: Final = {"photometric": 1.0, "geometry": 0.1, "smoothness": 0.1, "labels": 1.0}


@dataclass(frozen=True, kw_only=True)
class DepthTrainingConfig(loop.LoopConfig):
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
    progress: Callable[[loop.Progress, DepthNet], None] | None = None,
) -> DepthNet:
    """Return the network with the running mean of its weights, in evaluation mode.

    It begins with the weights of `start`, and continues from the checkpoint if there is one;
    WeightsError if either belongs to another network or run. Progress is told after every step.
    """
    torch.manual_seed(config.seed)
    net = loop.channels_last(DepthNet(net_config))
    pose = loop.channels_last(PoseNet()) if config.pose == "network" else None
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

    data = {"training": asdict(config), "net": asdict(net_config)}
    return loop.train(
        net, objective, config, "depth", data, checkpoint=checkpoint, progress=progress, beside=pose
    )


def predict_depth(net: DepthNet, rgb: Image) -> Floats32:
    """Return the depth of images, (N, H, W, 3), along the optical axis, (N, H/2, W/2)."""
    planes = torch.from_numpy(np.ascontiguousarray(rgb.transpose(0, 3, 1, 2))).float().div_(255.0)
    planes = planes.to(next(net.parameters()).device, memory_format=torch.channels_last)
    with torch.inference_mode():
        depth = net(planes)
    return np.asarray(depth[:, 0].cpu().numpy(), dtype=np.float32)
