"""Balance of classes: rare ones are drawn more often and weigh more in the loss."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

_SHOWN: Final = 0.002  # least share of an image's pixels with which it shows a class
_LIMITS: Final = (0.3, 6.0)  # of the weights in the loss


@dataclass(frozen=True, kw_only=True, eq=False)
class ClassBalance:
    """How images are drawn and classes are weighted.

    Attributes:
        image_shares: (N,) probability of drawing each image; they sum to one.
        class_weights: (C,) float32 weight of each class in the loss. Its mean over all pixels is
            one, apart from the limits.
    """

    image_shares: NDArray[np.float64]
    class_weights: NDArray[np.float32]


def balance_classes(ids: NDArray[np.uint8], classes: int) -> ClassBalance:
    """Return the balance of a training set.

    A class that no image shows changes nothing.

    Args:
        ids: (N, H, W) uint8 class ids; larger ones do not count.
        classes: Number C of classes.
    """
    counts = np.stack([np.bincount(each.ravel(), minlength=256)[:classes] for each in ids])
    shown = counts >= _SHOWN * ids[0].size
    images = np.maximum(shown.sum(axis=0), 1)
    # Half of the draws take a class first and then an image that shows it, the others any image.
    by_class = np.where(shown, 1.0 / images, 0.0).sum(axis=1)
    even = np.full(len(ids), 1.0 / len(ids))
    total = by_class.sum()
    shares = 0.5 * even + 0.5 * by_class / total if total > 0.0 else even
    frequency = counts.sum(axis=0) / max(int(counts.sum()), 1)
    weights = np.where(frequency > 0.0, 1.0 / np.sqrt(np.maximum(frequency, 1e-9)), 0.0)
    mean = float((frequency * weights).sum())
    weights = np.clip(weights / (mean or 1.0), *_LIMITS)
    return ClassBalance(image_shares=shares, class_weights=weights.astype(np.float32))
