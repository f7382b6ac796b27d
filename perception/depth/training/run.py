"""Training of the depth network on flights.

Three sources of supervision, alone or combined, need no true depth: neighbouring frames (through
telemetry or a pose network), labels from masks and geometry (`perception.depth.contact.depth`), and
smoothness. A simulator's exact depth can be used as labels, as an upper bound for comparison.

Importing this module imports torch.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Final, Literal

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from perception.depth.training.clips import ClipConfig, ClipSource
from perception.depth.training.network import DEPTH_FILES, DepthNet, DepthNetConfig, PoseNet
from perception.depth.training.objective import Batch, consistency_terms, supervision_terms
from perception.networks.training.loop import (
    LoopConfig,
    Progress,
    channels_last,
    ignore_progress,
    train,
)
from uav_bt.errors import UnknownNameError, ValueRangeError, WeightsError

_POSES: Final = ("telemetry", "network")


@dataclass(frozen=True, kw_only=True)
class DepthTrainingConfig(LoopConfig):
    """How the depth network is trained. The weights of the terms are SC-Depth's."""

    steps: int = 2500
    batch: int = 4  # clips per step, of three frames each
    learning_rate: float = 1e-3  # peak; AdamW. SC-Depth's 1e-4 starts from a trained encoder
    max_norm: float = 1.0
    pose: Literal["telemetry", "network"] = "telemetry"  # source of the camera's motion
    photometric: float = 1.0  # weight; zero, with geometry, learns from labels alone
    geometry: float = 0.1  # weight
    smoothness: float = 0.1  # weight
    labels: float = 1.0  # weight, where the flights come with labels
    clips: ClipConfig = field(default_factory=ClipConfig)
    checkpoint_every: int = 100  # steps

    def __post_init__(self) -> None:
        super().__post_init__()
        weights = (self.photometric, self.geometry, self.smoothness, self.labels)
        if min(weights) < 0.0 or not any(weights):
            raise ValueRangeError(f"weights must not be negative nor all zero, got {weights}")
        if self.pose not in _POSES:
            raise UnknownNameError("source of the pose", self.pose, _POSES)

    @property
    def compares_frames(self) -> bool:
        """Whether neighbouring frames are compared."""
        return self.photometric > 0.0 or self.geometry > 0.0


def train_depth(
    clips: ClipSource,
    config: DepthTrainingConfig,
    net_config: DepthNetConfig,
    *,
    start: Path | None = None,
    checkpoint: Path | None = None,
    progress: Callable[[Progress, DepthNet], None] = ignore_progress,
) -> DepthNet:
    """Train the network, or continue from the checkpoint if there is one.

    Args:
        clips: training data.
        config: how to train.
        net_config: the network's shape.
        start: initial weights, a file of `DEPTH_FILES`; None for random ones.
        checkpoint: file of the run's state; read first if it exists.
        progress: called after every step with the averaged network.

    Returns:
        The network with the running mean of its weights, in evaluation mode.

    Raises:
        WeightsError: the checkpoint is damaged or belongs to another run, or the initial weights
            belong to another network.
        ValueRangeError: the loss has become NaN or infinite, the training data are empty, or the
            flights' frames do not have the network's size.
    """
    _check(clips, config, net_config)
    torch.manual_seed(config.seed)
    net = channels_last(DepthNet(net_config))
    pose = channels_last(PoseNet()) if config.pose == "network" else None
    if start is not None:
        trained, _ = DEPTH_FILES.load(start)
        try:
            net.load_state_dict(trained.state_dict())
        except RuntimeError as error:
            raise WeightsError(start, "belongs to a network of another shape") from error
    draw = clips.draw if config.compares_frames else clips.draw_frames
    weights = asdict(config)

    def objective(rng: np.random.Generator) -> tuple[Tensor, Mapping[str, Tensor]]:
        batch = Batch([draw(rng) for _ in range(config.batch)], config.device)
        depth = net(batch.images)
        terms = consistency_terms(batch, depth, pose) if config.compares_frames else {}
        terms |= supervision_terms(batch, depth)
        terms = {name: term for name, term in terms.items() if weights[name] > 0.0}
        return torch.stack([weights[name] * term for name, term in terms.items()]).sum(), terms

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


def _check(clips: ClipSource, config: DepthTrainingConfig, net_config: DepthNetConfig) -> None:
    if not config.compares_frames and not (clips.labelled and config.labels > 0.0):
        raise ValueRangeError(
            "without comparing frames only labels teach, and these flights have none"
        )
    if clips.size_px != (net_config.width_px, net_config.height_px):
        width, height = clips.size_px
        raise ValueRangeError(
            f"the network takes {net_config.width_px}x{net_config.height_px} images, the "
            f"flights' are {width}x{height}"
        )


def predict_depth(net: DepthNet, rgb: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Return the depth of images along the optical axis.

    Args:
        net: the network, in evaluation mode.
        rgb: (N, H, W, 3) uint8, at the network's size.

    Returns:
        (N, H/2, W/2) float32.
    """
    planes = torch.from_numpy(np.ascontiguousarray(rgb.transpose(0, 3, 1, 2))).float().div_(255.0)
    planes = planes.to(next(net.parameters()).device, memory_format=torch.channels_last)
    with torch.inference_mode():
        depth = net(planes)
    return np.asarray(depth[:, 0].cpu().numpy(), dtype=np.float32)
