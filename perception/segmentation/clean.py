"""From votes to a clean class map: the paper's dotted grid and its largest components.

Mocanu et al. (arXiv 2510.16624, experiments on the first level) classify every fifth pixel, dilate
the dots until they join, and keep the largest connected component of each class but carpet and
background.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from uav_bt.classes import BACKGROUND, CARPET, CLASS_COUNT
from uav_bt.errors import ShapeError, ValueRangeError

_WITHOUT_COMPONENTS: Final = (BACKGROUND, CARPET)  # many separate pieces of these are normal


def dilated_grid(
    ids: NDArray[np.uint8], *, step_px: int = 5, dilation_px: int = 7
) -> NDArray[np.uint8]:
    """Return the class map that a grid of dots and a dilation make of it.

    Classes are painted in the order of their ids, so that an object wins the margin over background
    and carpet; the paper accepts those additional pixels.

    Args:
        ids: (H, W) uint8, the class of each window.
        step_px: distance of the dots.
        dilation_px: side of the square each dot becomes; at least the step, so that no gap stays.

    Raises:
        ShapeError: the ids are not (H, W).
        ValueRangeError: step and dilation leave gaps.
    """
    if ids.ndim != 2:
        raise ShapeError("class ids", expected="HxW", actual=ids.shape)
    if not 1 <= step_px <= dilation_px:
        raise ValueRangeError(f"dots every {step_px} pixels need a dilation of at least as much")
    dots = np.zeros(ids.shape, dtype=bool)
    dots[step_px // 2 :: step_px, step_px // 2 :: step_px] = True
    kernel = np.ones((dilation_px, dilation_px), dtype=np.uint8)
    empty = CLASS_COUNT
    painted = np.full(ids.shape, empty, dtype=np.uint8)
    for class_id in np.unique(ids[dots]).tolist():
        mask = (dots & (ids == class_id)).astype(np.uint8)
        painted[cv2.dilate(mask, kernel).astype(bool)] = class_id
    return _absorbed(painted, painted == empty)


def keep_largest_components(ids: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return the map with one component a class; the rest takes the class of what is around it.

    Background and carpet keep all their pieces.

    Args:
        ids: (H, W) uint8 class ids.
    """
    stray = np.zeros(ids.shape, dtype=bool)
    for class_id in np.unique(ids).tolist():
        if class_id in _WITHOUT_COMPONENTS:
            continue
        count, labels, stats, _ = cv2.connectedComponentsWithStats(
            (ids == class_id).astype(np.uint8), connectivity=8
        )
        if count > 2:
            largest = 1 + int(np.argmax(stats[1:, cv2.CC_STAT_AREA]))
            stray |= (labels > 0) & (labels != largest)
    return _absorbed(ids, stray)


def drop_small_components(ids: NDArray[np.uint8], *, area_px: int) -> NDArray[np.uint8]:
    """Return the map without pieces of any class smaller than an area.

    Unlike `keep_largest_components` it lets a class have several pieces: a box behind another box,
    or two boxes under the same roof pattern.

    Args:
        ids: (H, W) uint8 class ids.
        area_px: smallest piece that stays.
    """
    stray = np.zeros(ids.shape, dtype=bool)
    for class_id in np.unique(ids).tolist():
        _, labels, stats, _ = cv2.connectedComponentsWithStats(
            (ids == class_id).astype(np.uint8), connectivity=8
        )
        small = stats[:, cv2.CC_STAT_AREA] < area_px
        small[0] = False
        stray |= small[labels]
    return _absorbed(ids, stray)


def filled_holes(
    ids: NDArray[np.uint8],
    *,
    inside: Collection[int],
    but: Collection[int] = (),
    area_px: int,
    surround: float = 0.95,
) -> NDArray[np.uint8]:
    """Return the map without holes: small pieces that one class surrounds.

    Args:
        ids: (H, W) uint8 class ids.
        inside: the classes whose holes are filled.
        but: classes whose pieces are never holes.
        area_px: largest piece that counts as a hole.
        surround: share of a piece's rim that must be the surrounding class.
    """
    filled = ids.copy()
    around = np.ones((3, 3), dtype=np.uint8)
    for class_id in set(np.unique(ids).tolist()) - set(but):
        _, labels, stats, _ = cv2.connectedComponentsWithStats(
            (ids == class_id).astype(np.uint8), connectivity=4
        )
        for label in np.flatnonzero(stats[:, cv2.CC_STAT_AREA] <= area_px).tolist():
            if label == 0:
                continue
            left, top, width, height = stats[label, :4].tolist()
            rows = slice(max(top - 1, 0), top + height + 1)
            columns = slice(max(left - 1, 0), left + width + 1)
            piece = (labels[rows, columns] == label).astype(np.uint8)
            rim = ids[rows, columns][(cv2.dilate(piece, around) > piece)]
            counts = np.bincount(rim, minlength=CLASS_COUNT)
            outer = int(counts.argmax())
            if outer in inside and counts[outer] >= surround * rim.size:
                filled[rows, columns][piece.astype(bool)] = outer
    return filled


def _absorbed(ids: NDArray[np.uint8], stray: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """Give stray pixels the class of the nearest pixel that is none."""
    if not stray.any() or stray.all():
        return ids.copy()
    _, nearest = cv2.distanceTransformWithLabels(
        stray.astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5, labelType=cv2.DIST_LABEL_PIXEL
    )
    # The label of every pixel is that of its nearest zero; the zeros say what class it stands for.
    class_of_label = np.zeros(int(nearest.max()) + 1, dtype=np.uint8)
    class_of_label[nearest[~stray]] = ids[~stray]
    return np.asarray(class_of_label[nearest], dtype=np.uint8)
