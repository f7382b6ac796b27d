"""Scores of class maps: confusion matrix and intersection over union, by class and by role."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from uav_bt.errors import ValueRangeError
from uav_bt.lab.classes import ROLE_NAMES, LabClasses
from uav_bt.types.arrays import Floats, Ids


def confusion(predicted: Ids, exact: Ids, classes: int) -> NDArray[np.int64]:
    """Return the (C, C) counts of pixels by exact class (row) and predicted class (column).

    Both maps have the same size, and ids below the number of classes.
    """
    # sklearn.metrics.confusion_matrix counts the same in 2.9 ms a mask where this takes 0.08 ms.
    pairs = exact.ravel().astype(np.int64) * classes + predicted.ravel()
    return np.bincount(pairs, minlength=classes**2).reshape(classes, classes)


@dataclass(frozen=True, kw_only=True, eq=False)
class SegmentationScore:
    """Pixel counts of a set of images, and scores from them.

    The intersection over union is over all pixels of the set. It is NaN for a class that is absent
    from all exact maps, and the mean leaves such a class out.
    """

    counts: NDArray[np.int64]  # (C, C), exact class by predicted class
    images: int
    classes: LabClasses

    @property
    def iou(self) -> Floats:
        """(C,) of each class, nan where the class is absent."""
        return _iou(self.counts)

    @property
    def role_counts(self) -> NDArray[np.int64]:
        """(4, 4) counts by exact role and predicted role."""
        roles = self.classes.roles(np.arange(len(self.classes), dtype=np.uint8))
        to_role = np.eye(len(ROLE_NAMES), dtype=np.int64)[roles]
        return np.asarray(to_role.T @ self.counts @ to_role)

    @property
    def role_iou(self) -> Floats:
        """(4,) intersection over union of each role, nan where the role is absent."""
        return _iou(self.role_counts)

    @property
    def miou(self) -> float:
        """Mean over the classes."""
        return float(np.nanmean(self.iou))

    @property
    def role_miou(self) -> float:
        """Mean over the roles."""
        return float(np.nanmean(self.role_iou))

    @property
    def accuracy(self) -> float:
        """Pixel accuracy: share of the pixels with the right class."""
        return float(np.diag(self.counts).sum() / self.counts.sum())

    def to_json(self) -> dict[str, Any]:
        """Return the scores as JSON values; None for a class or role that is absent."""
        return {
            "images": self.images,
            "accuracy": round(self.accuracy, 4),
            "role_miou": round(self.role_miou, 4),
            "miou": round(self.miou, 4),
            "role_iou": _by_name(ROLE_NAMES, self.role_iou),
            "class_iou": _by_name(self.classes.names, self.iou),
        }


def _iou(counts: NDArray[np.int64]) -> Floats:
    both = np.diag(counts).astype(np.float64)
    exact = counts.sum(axis=1)
    either = counts.sum(axis=0) + exact - both
    iou = np.full(len(both), np.nan)
    np.divide(both, either, out=iou, where=exact > 0)
    return iou


def _by_name(names: Sequence[str], values: Floats) -> dict[str, float | None]:
    pairs = zip(names, values.tolist(), strict=True)
    return {name: None if math.isnan(value) else round(value, 4) for name, value in pairs}


def score_segmentation(pairs: Iterable[tuple[Ids, Ids]], classes: LabClasses) -> SegmentationScore:
    """Score predicted maps, (H, W), against exact ones.

    An exact map of another size is resized to the predicted one's (nearest pixel), so each network
    is scored at its resolution.
    """
    counts, images = np.zeros((len(classes),) * 2, dtype=np.int64), 0
    for predicted, exact in pairs:
        truth = cv2.resize(exact, predicted.shape[::-1], interpolation=cv2.INTER_NEAREST_EXACT)
        counts += confusion(predicted, np.asarray(truth, dtype=np.uint8), len(classes))
        images += 1
    if images == 0:
        raise ValueRangeError("cannot score a segmentation on no images")
    return SegmentationScore(counts=counts, images=images, classes=classes)
