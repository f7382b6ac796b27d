"""The terms of the depth network's loss on a batch of clips. Importing this imports torch."""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional

from perception.depth.training.clip import Clip
from perception.depth.training.losses import (
    ConsistencyMaps,
    best_of,
    consistency_maps,
    invert_motion,
    label_loss,
    masked_mean,
    smoothness_loss,
)
from perception.depth.training.network import PoseNet


class Batch:
    """Clips as tensors, ordered by frame, so that all targets come first.

    Args:
        clips: N clips, all with labels or all without.
        device: device of the tensors.
    """

    def __init__(self, clips: list[Clip], device: str) -> None:
        images = _stacked([clip.images for clip in clips], device).flatten(0, 1)
        self.images = images.contiguous(memory_format=torch.channels_last)
        self.motions = _stacked([clip.motions for clip in clips], device)
        self.intrinsics = _stacked([clip.intrinsics for clip in clips], device, axis=0)
        self.labels = _maps([clip.labels for clip in clips], device)
        self.at_most = _maps([clip.at_most for clip in clips], device)


def _stacked(arrays: list[NDArray[np.float32]], device: str, *, axis: int = 1) -> Tensor:
    return torch.from_numpy(np.stack(arrays, axis=axis)).to(device)


def _maps(maps: list[NDArray[np.float32] | None], device: str) -> Tensor | None:
    known = [each for each in maps if each is not None]
    if len(known) < len(maps):
        return None
    return _stacked(known, device).flatten(0, 1).unsqueeze(1)


def supervision_terms(batch: Batch, depth: Tensor) -> dict[str, Tensor]:
    """Return `smoothness` and, where the batch has labels, `labels`.

    Args:
        batch: N clips of three frames.
        depth: (3 N, 1, H/2, W/2), the prediction for their images.
    """
    terms = {"smoothness": smoothness_loss(depth, _at_depth_size(batch.images))}
    if batch.labels is not None:
        terms["labels"] = label_loss(depth, batch.labels, batch.at_most)
    return terms


def _at_depth_size(images: Tensor) -> Tensor:
    # Compared at the size of the depth, which is four times faster and loses no detail.
    return functional.avg_pool2d(images, 2)


def consistency_terms(batch: Batch, depth: Tensor, pose: PoseNet | None) -> dict[str, Tensor]:
    """Return the consistency errors of neighbouring frames: `photometric` and `geometry`.

    Args:
        batch: N clips of three frames.
        depth: (3 N, 1, H/2, W/2), the prediction for their images.
        pose: network for the camera's motions; None for the motions of the batch.
    """
    images = _at_depth_size(batch.images)
    target, *references = images.chunk(3)
    target_depth, *reference_depths = depth.chunk(3)
    there, back = _motions(batch, pose, target, references)
    fx, fy, cx, cy = batch.intrinsics.unbind(dim=1)
    halved = torch.stack([fx, fy, cx - 0.5, cy - 0.5], dim=1) / 2.0
    pairs = len(references)
    # All pairs in both directions at once.
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
    batch: Batch, pose: PoseNet | None, target: Tensor, references: list[Tensor]
) -> tuple[list[Tensor], list[Tensor]]:
    """Return the motions from the target to each reference, and back."""
    if pose is None:
        there = list(batch.motions.unbind(dim=0))
        return there, [invert_motion(motion) for motion in there]
    firsts = torch.cat([target] * len(references) + references)
    seconds = torch.cat(references + [target] * len(references))
    motions = list(pose(firsts, seconds).chunk(2 * len(references)))
    return motions[: len(references)], motions[len(references) :]
