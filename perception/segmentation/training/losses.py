"""The losses the paper compared: categorical cross-entropy, and binary cross-entropy with Dice.

Mocanu et al. (arXiv 2510.16624, experiments on the first level) found cross-entropy best. Importing
this module imports torch.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Final

from torch import Tensor
from torch.nn import functional

_SMOOTHING: Final = 1.0  # pixels; keeps an absent class from giving 0 / 0 in the Dice term


def cross_entropy(logits: Tensor, ids: Tensor, ignored: int) -> Tensor:
    """Return the mean categorical cross-entropy.

    Args:
        logits: (N, C, H, W) float.
        ids: (N, H, W) int64 class ids.
        ignored: the id of pixels that do not count.
    """
    return functional.cross_entropy(logits, ids, ignore_index=ignored)


def bce_dice(logits: Tensor, ids: Tensor, ignored: int) -> Tensor:
    """Return binary cross-entropy over one mask a class, plus the classes' mean Dice loss.

    Args:
        logits: (N, C, H, W) float.
        ids: (N, H, W) int64 class ids.
        ignored: the id of pixels that do not count.
    """
    classes = logits.shape[1]
    counts = (ids != ignored).unsqueeze(1).to(logits.dtype)
    masks = functional.one_hot(ids.where(ids != ignored, 0), classes).permute(0, 3, 1, 2)
    target = masks.to(logits.dtype) * counts
    bce = functional.binary_cross_entropy_with_logits(logits, target, reduction="none")
    mean_bce = (bce * counts).sum() / (counts.sum() * classes).clamp(min=1.0)
    probability = logits.sigmoid() * counts
    overlap = (probability * target).sum(dim=(0, 2, 3))
    total = probability.sum(dim=(0, 2, 3)) + target.sum(dim=(0, 2, 3))
    dice = (2.0 * overlap + _SMOOTHING) / (total + _SMOOTHING)
    return mean_bce + (1.0 - dice).mean()


LOSSES: Final[Mapping[str, Callable[[Tensor, Tensor, int], Tensor]]] = MappingProxyType(
    {"cross_entropy": cross_entropy, "bce_dice": bce_dice}
)
