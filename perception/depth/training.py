"""Train the depth network on flights; a run can be broken off and resumed to the same result.

Three teachers, alone or together, none of which needs the true depth: the neighbouring frames
(through telemetry or a pose network), labels that masks and geometry give
(`perception.depth.footing`), and smoothness. Exact depth, where a simulator has it, is only a kind
of labels: the upper bound to compare with.

Importing this module imports torch.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Final, Literal, TypeVar

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional

from perception.depth.clips import Clip, ClipConfig, ClipSource
from perception.depth.export import load_depth_tensors
from perception.depth.losses import (
    ConsistencyMaps,
    best_of,
    consistency_maps,
    label_loss,
    masked_mean,
    smoothness_loss,
)
from perception.depth.network import DepthNet, DepthNetConfig
from perception.depth.pose_network import PoseNet
from perception.depth.warping import invert_motion
from perception.weights_io import read_weights, write_weights
from uav_bt.errors import UnknownNameError, ValueRangeError, WeightsError

__all__ = ["DepthProgress", "DepthTrainingConfig", "predict_depth", "train_depth"]

_KIND: Final = "depth-checkpoint"
_POSES: Final = ("telemetry", "network")

_Module = TypeVar("_Module", bound=nn.Module)


@dataclass(frozen=True, kw_only=True)
class DepthTrainingConfig:
    """How the depth network is trained. The weights of the terms are SC-Depth's."""

    steps: int = 2500
    batch: int = 4  # clips a step, of three frames each
    learning_rate: float = 1e-3  # peak; AdamW. SC-Depth's 1e-4 starts from a trained encoder
    weight_decay: float = 1e-4
    warm_up_steps: int = 100  # linear rise, then half a cosine down to nothing
    pose: Literal["telemetry", "network"] = "telemetry"  # where the camera's movement comes from
    photometric: float = 1.0  # weight; nought, with geometry, learns from labels alone
    geometry: float = 0.1  # weight
    smoothness: float = 0.1  # weight
    labels: float = 1.0  # weight, where the flights come with labels
    average: float = 0.99  # decay of the running mean of the weights, which is what is kept
    clips: ClipConfig = field(default_factory=ClipConfig)
    seed: int = 0  # of the first weights, the order of the clips and their changes
    checkpoint_every: int = 100  # steps

    def __post_init__(self) -> None:
        if min(self.steps, self.batch, self.checkpoint_every) < 1 or self.learning_rate <= 0.0:
            raise ValueRangeError(
                "steps, batch, checkpoint_every and learning_rate must be positive, got "
                f"{self.steps}, {self.batch}, {self.checkpoint_every}, {self.learning_rate}"
            )
        weights = (self.photometric, self.geometry, self.smoothness, self.labels)
        if min(weights) < 0.0 or not any(weights):
            raise ValueRangeError(f"weights must not be negative nor all nought, got {weights}")
        if not 0.0 <= self.average < 1.0:
            raise ValueRangeError(f"average must lie within 0 and 1, got {self.average}")
        if self.pose not in _POSES:
            raise UnknownNameError("source of the pose", self.pose, _POSES)

    @property
    def compares_frames(self) -> bool:
        """Whether neighbouring frames teach."""
        return self.photometric > 0.0 or self.geometry > 0.0


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
        ValueRangeError: the loss is no longer finite, or nothing teaches.
    """
    if not config.compares_frames and not clips.labelled:
        raise ValueRangeError(
            "without comparing frames only labels teach, and these flights have none"
        )
    torch.manual_seed(config.seed)
    run = _Run(config, net_config)
    if checkpoint is not None and checkpoint.is_file():
        run.load(checkpoint)
    elif start is not None:
        run.begin_with(start)
    while run.step < config.steps:
        # Drawn from seed and step alone: a resumed run sees what an unbroken one would have seen.
        rng = np.random.default_rng((config.seed, run.step))
        draw = clips.draw if config.compares_frames else clips.draw_frames
        loss, terms = run.learn(_Batch([draw(rng) for _ in range(config.batch)]))
        if not math.isfinite(loss):
            raise ValueRangeError(
                f"the loss is {loss} after {run.step} steps; lower the learning rate"
            )
        if checkpoint is not None and (
            run.step % config.checkpoint_every == 0 or run.step == config.steps
        ):
            run.save(checkpoint)
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


class _Batch:
    """Clips as tensors: frame by frame, so that all targets come first."""

    def __init__(self, clips: list[Clip]) -> None:
        images = torch.from_numpy(np.stack([clip.images for clip in clips], axis=1))
        self.count = len(clips)
        self.images = images.flatten(0, 1).contiguous(memory_format=torch.channels_last)
        self.motions = torch.from_numpy(np.stack([clip.motions for clip in clips], axis=1))
        self.intrinsics = torch.from_numpy(np.stack([clip.intrinsics for clip in clips]))
        self.labels = _stacked([clip.labels for clip in clips])
        self.at_most = _stacked([clip.at_most for clip in clips])


def _stacked(maps: list[NDArray[np.float32] | None]) -> Tensor | None:
    known = [each for each in maps if each is not None]
    if len(known) < len(maps):
        return None
    return torch.from_numpy(np.stack(known, axis=1)).flatten(0, 1).unsqueeze(1)


class _Run:
    """The state of a training run: networks, running mean, optimiser and step."""

    def __init__(self, config: DepthTrainingConfig, net_config: DepthNetConfig) -> None:
        self.config = config
        self.step = 0
        self.net = _channels_last(DepthNet(net_config))
        self.mean = _channels_last(DepthNet(net_config))
        self.mean.load_state_dict(self.net.state_dict())
        self.pose = _channels_last(PoseNet()) if config.pose == "network" else None
        self.parameters = [
            *self.net.parameters(),
            *(self.pose.parameters() if self.pose is not None else ()),
        ]
        self.optimiser = torch.optim.AdamW(
            self.parameters, lr=config.learning_rate, weight_decay=config.weight_decay
        )
        self._about = json.dumps(
            {"training": asdict(config), "net": asdict(net_config)}, sort_keys=True
        )

    def begin_with(self, weights: Path) -> None:
        """Take over a trained network's weights."""
        tensors, _ = load_depth_tensors(weights)
        known = {name: torch.from_numpy(tensor) for name, tensor in tensors.items()}
        try:
            for net in (self.net, self.mean):
                # The files leave out how many batches the norms have seen: nothing needs it.
                counts = {
                    name: count
                    for name, count in net.state_dict().items()
                    if name.endswith("num_batches_tracked")
                }
                net.load_state_dict({**counts, **known})
        except RuntimeError as error:
            raise WeightsError(weights, "belongs to a network of another shape") from error

    def learn(self, batch: _Batch) -> tuple[float, dict[str, float]]:
        """Do one step; return its loss and the terms it is made of."""
        for group in self.optimiser.param_groups:
            group["lr"] = self.config.learning_rate * self._rate()
        self.net.train()
        terms = self._terms(batch)
        weights = asdict(self.config)
        loss = torch.stack([weights[name] * term for name, term in terms.items()]).sum()
        self.optimiser.zero_grad(set_to_none=True)
        torch.autograd.backward(loss)
        nn.utils.clip_grad_norm_(self.parameters, 1.0)
        self.optimiser.step()
        self.step += 1
        self._follow()
        told = {name: float(term.detach()) for name, term in terms.items()}
        return float(loss.detach()), told

    def _terms(self, batch: _Batch) -> dict[str, Tensor]:
        config = self.config
        depth = self.net(batch.images)
        # Compared at the depth's own size: four times quicker, and the network has no finer detail.
        images = functional.avg_pool2d(batch.images, 2)
        terms: dict[str, Tensor] = {}
        if config.compares_frames:
            terms |= self._consistency(batch, images, depth)
        if config.smoothness > 0.0:
            terms["smoothness"] = smoothness_loss(depth, images)
        if config.labels > 0.0 and batch.labels is not None:
            terms["labels"] = label_loss(depth, batch.labels, batch.at_most)
        return terms

    def _consistency(self, batch: _Batch, images: Tensor, depth: Tensor) -> dict[str, Tensor]:
        target, *references = images.chunk(3)
        target_depth, *reference_depths = depth.chunk(3)
        there, back = self._motions(batch, target, references)
        fx, fy, cx, cy = batch.intrinsics.unbind(dim=1)
        halved = torch.stack([fx, fy, cx - 0.5, cy - 0.5], dim=1) / 2.0
        pairs = len(references)
        # All pairs both ways in one go.
        maps = consistency_maps(
            torch.cat([target] * pairs + references),
            torch.cat(references + [target] * pairs),
            (
                torch.cat([target_depth] * pairs + reference_depths),
                torch.cat(reference_depths + [target_depth] * pairs),
            ),
            torch.cat([*there, *back]),
            halved.repeat(2 * pairs, 1),
        )
        parts = [
            ConsistencyMaps(photometric=photometric, geometric=geometric, mask=mask)
            for photometric, geometric, mask in zip(
                maps.photometric.chunk(2 * pairs),
                maps.geometric.chunk(2 * pairs),
                maps.mask.chunk(2 * pairs),
                strict=True,
            )
        ]
        kept = [best_of(parts[:pairs]), *parts[pairs:]]
        mask = torch.cat([each.mask for each in kept])
        return {
            "photometric": masked_mean(torch.cat([each.photometric for each in kept]), mask),
            "geometry": masked_mean(torch.cat([each.geometric for each in kept]), mask),
        }

    def _motions(
        self, batch: _Batch, target: Tensor, references: list[Tensor]
    ) -> tuple[list[Tensor], list[Tensor]]:
        """Return the movements from the target to each reference, and back."""
        if self.pose is None:
            there = list(batch.motions.unbind(dim=0))
            return there, [invert_motion(motion) for motion in there]
        self.pose.train()
        firsts = torch.cat([target] * len(references) + references)
        seconds = torch.cat(references + [target] * len(references))
        motions = list(self.pose(firsts, seconds).chunk(2 * len(references)))
        return motions[: len(references)], motions[len(references) :]

    def _rate(self) -> float:
        warm = min(1.0, (self.step + 1) / self.config.warm_up_steps)
        return warm * 0.5 * (1.0 + math.cos(math.pi * self.step / self.config.steps))

    @torch.no_grad()
    def _follow(self) -> None:
        # The early mean forgets faster, so that it does not drag the first random weights along.
        decay = min(self.config.average, self.step / (self.step + 10.0))
        ours = self.net.state_dict()
        for name, value in self.mean.state_dict().items():
            if value.is_floating_point():
                value.lerp_(ours[name], 1.0 - decay)
            else:
                value.copy_(ours[name])

    # --- keeping it -------------------------------------------------------------------------------

    def _modules(self) -> dict[str, nn.Module]:
        modules: dict[str, nn.Module] = {"net": self.net, "mean": self.mean}
        return modules if self.pose is None else {**modules, "pose": self.pose}

    def save(self, path: Path) -> None:
        tensors: dict[str, NDArray[Any]] = {}
        for name, module in self._modules().items():
            tensors |= _named(name, module.state_dict())
        for index, state in self.optimiser.state_dict()["state"].items():
            tensors |= _named(f"optimiser/{index}", state)
        write_weights(path, tensors, kind=_KIND, details={"step": self.step, "about": self._about})

    def load(self, path: Path) -> None:
        cure = "delete the file to start the run anew"
        tensors, details = read_weights(path, kind=_KIND, cure=cure)
        if details.get("about") != self._about:
            raise WeightsError(path, f"belongs to a run with other settings; {cure}")
        try:
            for name, module in self._modules().items():
                module.load_state_dict(_under(name, tensors))
            whole = self.optimiser.state_dict()
            whole["state"] = {
                index: _under(f"optimiser/{index}", tensors)
                for index in range(len(self.parameters))
            }
            self.optimiser.load_state_dict(whole)
            self.step = int(details["step"])
        except (KeyError, ValueError, RuntimeError) as error:
            raise WeightsError(path, f"is not a whole checkpoint ({error}); {cure}") from error


def _channels_last(net: _Module) -> _Module:
    # A third faster on the CPU. Not `net.to(memory_format=...)`: torch's stubs do not know it.
    for parameter in net.parameters():
        if parameter.ndim == 4:
            parameter.data = parameter.data.contiguous(memory_format=torch.channels_last)
    return net


def _named(prefix: str, tensors: Mapping[str, Tensor]) -> dict[str, NDArray[Any]]:
    return {f"{prefix}/{name}": tensor.detach().numpy() for name, tensor in tensors.items()}


def _under(prefix: str, tensors: Mapping[str, NDArray[Any]]) -> dict[str, Tensor]:
    start = f"{prefix}/"
    return {
        name.removeprefix(start): torch.from_numpy(tensor.copy())
        for name, tensor in tensors.items()
        if name.startswith(start)
    }
