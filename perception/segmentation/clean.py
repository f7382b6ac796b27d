"""Clean class maps from the teacher's windows: the paper's procedure, and sharper borders.

Mocanu et al. (arXiv 2510.16624, experiments on the first level) classify every fifth pixel, dilate
the dots until they join, and keep the largest connected component of each class but carpet and
background.

A 40-pixel window displaces the border of a class by up to 20 pixels, and the student would learn
this error. `sharpened` is not from the paper. By Bayes' rule it multiplies, for every pixel, the
share of a class in the neighbourhood (the prior) by the probability of the pixel's colour in the
class's palette (the likelihood). The result is a better prior for the next round.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.segmentation.features import colour_codes
from uav_bt.lab.classes import NO_ROLE
from uav_bt.types.arrays import Flags, Floats32, Ids, Image

_STEP_PX: Final = 5  # between the paper's dots
_DILATION_PX: Final = 7  # side of the square around each dot

# Chosen on the validation scenes, in pixels of the teacher's 1152x648 image.
_ROUNDS: Final = 3
_NEIGHBOURHOOD_PX: Final = 41  # side of the square for the prior; about a patch
_PRIOR_WEIGHT: Final = 3.0  # of the prior's logarithm; neighbouring pixels are not independent
_BLUR_PX: Final = 1.0  # standard deviation of the smoothing of likelihoods, against image noise
SMALLEST_PX: Final = 100  # area; smaller pieces are noise
HOLE_PX: Final = 4000  # area; smaller holes in a box's side are its pattern
# What a refined map depends on besides teacher and image, for the names of kept maps.
REFINED_BY: Final = {
    "rounds": _ROUNDS,
    "neighbourhood_px": _NEIGHBOURHOOD_PX,
    "prior_weight": _PRIOR_WEIGHT,
    "blur_px": _BLUR_PX,
    "smallest_px": SMALLEST_PX,
    "hole_px": HOLE_PX,
}
_MIN_SHARE: Final = 1e-4  # added to the prior to keep its logarithm finite
_SURROUND: Final = 0.95  # share of a hole's rim that must be of the class around it


def dilated_grid(ids: Ids) -> Ids:
    """Return the class map, (H, W), after sampling a grid of dots and dilating them.

    Classes are painted in the order of their ids, so that objects cover the margin around them.
    """
    dots = np.zeros(ids.shape, dtype=bool)
    dots[_STEP_PX // 2 :: _STEP_PX, _STEP_PX // 2 :: _STEP_PX] = True
    kernel = np.ones((_DILATION_PX, _DILATION_PX), dtype=np.uint8)
    painted = np.full(ids.shape, NO_ROLE, dtype=np.uint8)
    for class_id in np.unique(ids[dots]).tolist():
        mask = (dots & (ids == class_id)).astype(np.uint8)
        painted[cv2.dilate(mask, kernel).astype(bool)] = class_id
    return _absorbed(painted, painted == NO_ROLE)


def keep_largest_components(ids: Ids, scattered: Collection[int]) -> Ids:
    """Return the map with one piece of each class but the scattered ones, such as the ground.

    Other pieces take the surrounding class.
    """
    stray = np.zeros(ids.shape, dtype=bool)
    for class_id in set(np.unique(ids).tolist()) - set(scattered):
        labels, areas_px, _ = _pieces(ids == class_id, 8)
        stray |= (labels > 0) & (labels != 1 + int(np.argmax(areas_px[1:])))
    return _absorbed(ids, stray)


def drop_small_components(ids: Ids, *, area_px: int) -> Ids:
    """Return the map without pieces of any class smaller than an area.

    A class may have several pieces: a box behind another box, or two boxes of the same pattern.
    """
    stray = np.zeros(ids.shape, dtype=bool)
    for class_id in np.unique(ids).tolist():
        labels, areas_px, _ = _pieces(ids == class_id, 8)
        stray |= (labels > 0) & (areas_px < area_px)[labels]
    return _absorbed(ids, stray)


def filled_holes(
    ids: Ids, *, inside: Collection[int], but: Collection[int | None] = (), area_px: int
) -> Ids:
    """Return the map without holes of at most an area, surrounded by one class of `inside`.

    Pieces of the classes `but` are never holes.
    """
    filled = ids.copy()
    around = np.ones((3, 3), dtype=np.uint8)
    for class_id in set(np.unique(ids).tolist()) - set(but):
        labels, areas_px, boxes = _pieces(ids == class_id, 4)
        for label in 1 + np.flatnonzero(areas_px[1:] <= area_px):
            left, top, width, height = boxes[label].tolist()
            part = np.s_[max(top - 1, 0) : top + height + 1, max(left - 1, 0) : left + width + 1]
            piece = (labels[part] == label).astype(np.uint8)
            rim = ids[part][cv2.dilate(piece, around) > piece]
            outer = int(np.bincount(rim).argmax())
            if outer in inside and np.count_nonzero(rim == outer) >= _SURROUND * rim.size:
                filled[part][piece.astype(bool)] = outer
    return filled


def _pieces(mask: Flags, connectivity: int) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    """Return labels of connected pieces, their areas and boxes; 0 is what is not in the mask."""
    found = cv2.connectedComponentsWithStats(mask.astype(np.uint8), connectivity=connectivity)
    return found[1], found[2][:, cv2.CC_STAT_AREA], found[2][:, :4]


def _absorbed(ids: Ids, stray: Flags) -> Ids:
    """Give stray pixels the class of the nearest other pixel."""
    if not stray.any() or stray.all():
        return ids.copy()
    _, nearest = cv2.distanceTransformWithLabels(
        stray.astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5, labelType=cv2.DIST_LABEL_PIXEL
    )
    # Each pixel has the label of its nearest zero, and each label has the class of its zero.
    class_of_label = np.zeros(int(nearest.max()) + 1, dtype=np.uint8)
    class_of_label[nearest[~stray]] = ids[~stray]
    return np.asarray(class_of_label[nearest], dtype=np.uint8)


def sharpened(ids: Ids, rgb: Image, palette: Floats32) -> Ids:
    """Return the map of windows, (H, W), of an image after the rounds of prior and likelihood.

    The palette has the log-likelihood of each coarse colour in each class, (C, 32768).
    """
    codes = colour_codes(rgb)
    present = np.unique(ids).tolist()
    likelihood = {
        each: cv2.GaussianBlur(palette[each][codes], (0, 0), _BLUR_PX) for each in present
    }
    square = (_NEIGHBOURHOOD_PX, _NEIGHBOURHOOD_PX)
    for _ in range(_ROUNDS):
        best = np.full(ids.shape, -np.inf, dtype=np.float32)
        better_ids = ids.copy()
        for class_id in present:
            mask = (ids == class_id).astype(np.float32)
            share = cv2.boxFilter(mask, cv2.CV_32F, square, borderType=cv2.BORDER_REPLICATE)
            score = likelihood[class_id] + _PRIOR_WEIGHT * cv2.log(share + _MIN_SHARE)
            better = score > best
            np.copyto(best, score, where=better)
            np.putmask(better_ids, better, np.uint8(class_id))
        ids = better_ids
    return ids
