"""Scores of class maps: confusion matrix and intersection over union, by class and by group."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from uav_bt.classes import CLASS_COUNT, CLASS_TO_GROUP, GROUP_COUNT
from uav_bt.errors import ShapeError, ValueRangeError


def confusion(predicted: NDArray[np.uint8], exact: NDArray[np.uint8]) -> NDArray[np.int64]:
    """Return the (17, 17) counts of pixels by exact class (row) and predicted class (column).

    Args:
        predicted: (H, W) uint8 class ids.
        exact: (H, W) uint8 class ids.

    Raises:
        ShapeError: the maps differ in size.
        ValueRangeError: an id is not one of the seventeen.
    """
    if predicted.shape != exact.shape:
        height, width = exact.shape[:2]
        raise ShapeError("predicted ids", expected=f"{height}x{width}", actual=predicted.shape)
    if max(int(predicted.max(initial=0)), int(exact.max(initial=0))) >= CLASS_COUNT:
        raise ValueRangeError("class ids must lie within 0 and 16")
    # sklearn.metrics.confusion_matrix counts the same in 2.9 ms a mask where this takes 0.08 ms.
    pairs = exact.ravel().astype(np.int64) * CLASS_COUNT + predicted.ravel()
    counts = np.bincount(pairs, minlength=CLASS_COUNT * CLASS_COUNT)
    return counts.reshape(CLASS_COUNT, CLASS_COUNT)


def _iou(counts: NDArray[np.int64]) -> NDArray[np.float64]:
    both = np.diag(counts).astype(np.float64)
    either = counts.sum(axis=0) + counts.sum(axis=1) - both
    iou = np.full(len(both), np.nan)
    np.divide(both, either, out=iou, where=counts.sum(axis=1) > 0)
    return iou


@dataclass(frozen=True, kw_only=True, eq=False)
class SegmentationScore:
    """Pixel counts of a set of images, and scores from them.

    The intersection over union is computed over all pixels of the set, not averaged over images. It
    is NaN for a class that is absent from all exact maps, and the mean leaves such a class out.
    Pixels wrongly given to it count against their exact classes.
    """

    counts: NDArray[np.int64]  # (17, 17), exact class by predicted class
    images: int

    @property
    def iou(self) -> NDArray[np.float64]:
        """(17,) intersection over union of each class, nan where the class is absent."""
        return _iou(self.counts)

    @property
    def group_counts(self) -> NDArray[np.int64]:
        """(4, 4) counts by exact group and predicted group."""
        to_group = np.zeros((CLASS_COUNT, GROUP_COUNT), dtype=np.int64)
        to_group[np.arange(CLASS_COUNT), CLASS_TO_GROUP] = 1
        return np.asarray(to_group.T @ self.counts @ to_group)

    @property
    def group_iou(self) -> NDArray[np.float64]:
        """(4,) intersection over union of each group, nan where the group is absent."""
        return _iou(self.group_counts)

    @property
    def miou(self) -> float:
        """Mean over the classes."""
        return float(np.nanmean(self.iou))

    @property
    def group_miou(self) -> float:
        """Mean over the groups."""
        return float(np.nanmean(self.group_iou))

    @property
    def accuracy(self) -> float:
        """Pixel accuracy: share of the pixels with the right class."""
        return float(np.diag(self.counts).sum() / self.counts.sum())


def score_segmentation(
    pairs: Iterable[tuple[NDArray[np.uint8], NDArray[np.uint8]]],
) -> SegmentationScore:
    """Score predicted maps against exact ones.

    Args:
        pairs: predicted and exact (H, W) ids. An exact map of another size is resized to the
            predicted one's (nearest pixel), so each network is scored at its resolution.

    Raises:
        ValueRangeError: `pairs` is empty, or an id is not one of the seventeen.
    """
    counts = np.zeros((CLASS_COUNT, CLASS_COUNT), dtype=np.int64)
    images = 0
    for predicted, exact in pairs:
        same = exact.shape == predicted.shape
        size = (predicted.shape[1], predicted.shape[0])
        truth = exact if same else cv2.resize(exact, size, interpolation=cv2.INTER_NEAREST_EXACT)
        counts += confusion(predicted, np.asarray(truth, dtype=np.uint8))
        images += 1
    if images == 0:
        raise ValueRangeError("cannot score a segmentation on no images")
    return SegmentationScore(counts=counts, images=images)
