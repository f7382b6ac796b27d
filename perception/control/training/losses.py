"""What the control student minimises. Imports torch."""

from __future__ import annotations

from typing import Final

import torch
from torch import Tensor
from torch.nn import functional as F  # noqa: N812 - everybody's name for it

# A free way taken for blocked costs a turn; the other way round it costs the drone.
_CAUTION: Final = 1.5
# Of metres, the quantile that is learnt: a step too short costs a stop, one too long more.
_QUANTILE: Final = 0.35
_SIDE, _METRES, _ENDS = 0.5, 2.0, 0.5


def choice_loss(prediction: Tensor, labels: Tensor, turning: Tensor) -> Tensor:
    """Return the loss of a choice, to advance or to turn, and of its particulars.

    The mean of an advance and a turn is neither, and that is what a squared error asks for where
    both are likely.

    Args:
        prediction: (N, 5) float, `config.OUTPUTS`.
        labels: (N, 4) float, the rule's decision: `samples.LABELS`.
        turning: (N,) float, the turn under way.
    """
    forward_m, yaw_rad, ends, free_m = labels.unbind(dim=1)
    advances = (forward_m > 0.0).float()
    choice = F.binary_cross_entropy_with_logits(
        prediction[:, 0], advances, weight=torch.where(advances > 0.0, 1.0, _CAUTION)
    )
    # A turn under way keeps its side: there is nothing to learn from it.
    begins = (forward_m <= 0.0) & (turning == 0.0)
    side = F.binary_cross_entropy_with_logits(
        prediction[:, 1], (yaw_rad > 0.0).float(), weight=begins.float()
    )
    step = _pinball(prediction[:, 2], forward_m, forward_m > 0.0)
    edge = F.binary_cross_entropy_with_logits(prediction[:, 3], ends)
    free = _pinball(prediction[:, 4], free_m, torch.isfinite(free_m))
    return choice + _SIDE * side + _METRES * (step + free) + _ENDS * edge


def _pinball(prediction: Tensor, truth: Tensor, counts: Tensor) -> Tensor:
    """Return the loss whose minimum is at a quantile (Koenker and Bassett, 1978)."""
    left = torch.where(counts, truth - prediction, 0.0)
    return torch.maximum(_QUANTILE * left, (_QUANTILE - 1.0) * left).mean()
