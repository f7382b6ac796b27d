"""What the control student minimises. Imports torch."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import torch
from torch import Tensor
from torch.nn import functional as F  # noqa: N812 - everybody's name for it

from perception.control.config import Learns

__all__ = ["LOSSES", "choice_loss", "movement_loss"]

# A free way taken for blocked costs a turn; the other way round it costs the drone.
_CAUTION: Final = 1.5
# Of metres, the quantile that is learnt: a step too short costs a stop, one too long more.
_QUANTILE: Final = 0.35
_SIDE, _METRES, _ENDS = 0.5, 2.0, 0.5


def movement_loss(said: Tensor, labels: Tensor, turning: Tensor) -> Tensor:
    """Return the paper's: the mean squared error of the movement.

    What the rule tells beside the movement is learnt in the same way, with a quarter of the weight.

    Args:
        said: (N, 5), the network's: `config.OUTPUTS`.
        labels: (N, 4), the rule's: `samples.LABELS`.
        turning: (N,), the turn under way.
    """
    del turning
    movement = F.mse_loss(said[:, :2], labels[:, :2])
    known = torch.isfinite(labels[:, 3])
    beside = (said[:, 3] - labels[:, 2]).square().mean()
    free = (said[known, 4] - labels[known, 3]).square().sum() / max(int(known.sum()), 1)
    return movement + 0.25 * (beside + free)


def choice_loss(said: Tensor, labels: Tensor, turning: Tensor) -> Tensor:
    """Return the loss of a choice, to advance or to turn, and of its particulars.

    The mean of an advance and a turn is neither, and that is what a squared error asks for where
    both are likely. Arguments as those of `movement_loss`.
    """
    forward_m, yaw_rad, ends, free_m = labels.unbind(dim=1)
    advances = (forward_m > 0.0).float()
    choice = F.binary_cross_entropy_with_logits(
        said[:, 0], advances, weight=torch.where(advances > 0.0, 1.0, _CAUTION)
    )
    # A turn under way keeps its side: there is nothing to learn from it.
    begins = (forward_m <= 0.0) & (turning == 0.0)
    side = F.binary_cross_entropy_with_logits(
        said[:, 1], (yaw_rad > 0.0).float(), weight=begins.float()
    )
    step = _pinball(said[:, 2], forward_m, forward_m > 0.0)
    edge = F.binary_cross_entropy_with_logits(said[:, 3], ends)
    free = _pinball(said[:, 4], free_m, torch.isfinite(free_m))
    return choice + _SIDE * side + _METRES * (step + free) + _ENDS * edge


def _pinball(said: Tensor, truth: Tensor, counts: Tensor) -> Tensor:
    """Return the loss whose least is at a quantile (Koenker and Bassett, 1978)."""
    left = torch.where(counts, truth - said, 0.0)
    return torch.maximum(_QUANTILE * left, (_QUANTILE - 1.0) * left).mean()


LOSSES: Final[dict[Learns, Callable[[Tensor, Tensor, Tensor], Tensor]]] = {
    "choice": choice_loss,
    "movement": movement_loss,
}
