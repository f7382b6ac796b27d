"""One step of training the depth network after the other, and the state that is kept of it.

Importing this module imports torch.
"""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Final

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional

from perception.depth.training.clip import Clip
from perception.depth.training.config import DepthTrainingConfig
from perception.depth.training.export import load_depth_tensors
from perception.depth.training.losses import (
    ConsistencyMaps,
    best_of,
    consistency_maps,
    label_loss,
    masked_mean,
    smoothness_loss,
)
from perception.depth.training.network import DepthNet, DepthNetConfig
from perception.depth.training.pose_network import PoseNet
from perception.depth.training.warping import invert_motion
from perception.networks.checkpoint import Checkpoint
from perception.networks.torch_state import channels_last, follow_mean, warm_cosine
from uav_bt.errors import WeightsError

__all__ = ["Batch", "Learner"]

_KIND: Final = "depth-checkpoint"


class Batch:
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


class Learner:
    """The state of a training run: networks, running mean, optimiser and step."""

    def __init__(self, config: DepthTrainingConfig, net_config: DepthNetConfig) -> None:
        self.config = config
        self.step = 0
        self.net = channels_last(DepthNet(net_config))
        self.mean = channels_last(DepthNet(net_config))
        self.mean.load_state_dict(self.net.state_dict())
        self.pose = channels_last(PoseNet()) if config.pose == "network" else None
        self.parameters = [
            *self.net.parameters(),
            *(self.pose.parameters() if self.pose is not None else ()),
        ]
        self.optimiser = torch.optim.AdamW(
            self.parameters, lr=config.learning_rate, weight_decay=config.weight_decay
        )
        modules: dict[str, nn.Module] = {"net": self.net, "mean": self.mean}
        if self.pose is not None:
            modules["pose"] = self.pose
        about = {"training": asdict(config), "net": asdict(net_config)}
        self.checkpoint = Checkpoint(
            kind=_KIND,
            about=json.dumps(about, sort_keys=True),
            modules=modules,
            optimiser=self.optimiser,
        )

    def begin_with(self, weights: Path) -> None:
        """Take over a trained network's weights.

        Raises:
            WeightsError: they are absent, damaged or of another shape.
        """
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

    def learn(self, batch: Batch) -> tuple[float, dict[str, float]]:
        """Do one step; return its loss and the terms it is made of."""
        rate = self.config.learning_rate * warm_cosine(
            self.step, warm_up=self.config.warm_up_steps, steps=self.config.steps
        )
        for group in self.optimiser.param_groups:
            group["lr"] = rate
        self.net.train()
        terms = self._terms(batch)
        weights = asdict(self.config)
        loss = torch.stack([weights[name] * term for name, term in terms.items()]).sum()
        self.optimiser.zero_grad(set_to_none=True)
        torch.autograd.backward(loss)
        nn.utils.clip_grad_norm_(self.parameters, 1.0)
        self.optimiser.step()
        self.step += 1
        follow_mean(self.mean, self.net, most=self.config.average, step=self.step)
        told = {name: float(term.detach()) for name, term in terms.items()}
        return float(loss.detach()), told

    def _terms(self, batch: Batch) -> dict[str, Tensor]:
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

    def _consistency(self, batch: Batch, images: Tensor, depth: Tensor) -> dict[str, Tensor]:
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
        self, batch: Batch, target: Tensor, references: list[Tensor]
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
