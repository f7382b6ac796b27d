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
from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.segmentation.features import colour_codes
from uav_bt.errors import ShapeError, ValueRangeError
from uav_bt.lab.classes import NO_ROLE

_MIN_SHARE: Final = 1e-4  # added to the prior to keep its logarithm finite
_SURROUND: Final = 0.95  # share of a hole's rim that must be of the class around it


def dilated_grid(
    ids: NDArray[np.uint8], *, step_px: int = 5, dilation_px: int = 7
) -> NDArray[np.uint8]:
    """Return the class map after sampling a grid of dots and dilating them.

    Classes are painted in the order of their ids, so that objects cover the margin of what
    lies around them; the paper accepts these additional pixels.

    Args:
        ids: (H, W) uint8, the class of each window.
        step_px: distance between dots.
        dilation_px: side of the square around each dot; at least the step, to leave no gap.

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
    empty = NO_ROLE
    painted = np.full(ids.shape, empty, dtype=np.uint8)
    for class_id in np.unique(ids[dots]).tolist():
        mask = (dots & (ids == class_id)).astype(np.uint8)
        painted[cv2.dilate(mask, kernel).astype(bool)] = class_id
    return _absorbed(painted, painted == empty)


def keep_largest_components(
    ids: NDArray[np.uint8], scattered: Collection[int]
) -> NDArray[np.uint8]:
    """Return the map with one component per class; other pieces take the surrounding class.

    Args:
        ids: (H, W) uint8 class ids.
        scattered: the classes that keep all their pieces, such as the ground.
    """
    stray = np.zeros(ids.shape, dtype=bool)
    for class_id in np.unique(ids).tolist():
        if class_id in scattered:
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

    Unlike `keep_largest_components` it allows several pieces of a class: a box behind another box,
    or two boxes under the same roof pattern.

    Args:
        ids: (H, W) uint8 class ids.
        area_px: area of the smallest piece that is kept.
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
) -> NDArray[np.uint8]:
    """Return the map without holes, which are small pieces surrounded by one class.

    Args:
        ids: (H, W) uint8 class ids.
        inside: the classes whose holes are filled.
        but: classes whose pieces are never holes.
        area_px: area of the largest piece that counts as a hole.
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
            counts = np.bincount(rim)
            outer = int(counts.argmax())
            if outer in inside and counts[outer] >= _SURROUND * rim.size:
                filled[rows, columns][piece.astype(bool)] = outer
    return filled


def _absorbed(ids: NDArray[np.uint8], stray: NDArray[np.bool_]) -> NDArray[np.uint8]:
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


@dataclass(frozen=True, kw_only=True)
class RefineConfig:
    """How borders are sharpened; pixels are those of the teacher's 1152x648 image.

    The numbers were chosen on the validation scenes.
    """

    rounds: int = 3  # 0 leaves the windows' classes unchanged
    neighbourhood_px: int = 41  # side of the square for the prior; about a patch
    prior_weight: float = 3.0  # of the prior's logarithm; neighbouring pixels are not independent
    blur_px: float = 1.0  # standard deviation of the smoothing of likelihoods, against image noise
    smallest_px: int = 100  # area; smaller pieces are noise
    hole_px: int = 4000  # area; smaller holes in a box's side are its pattern

    def __post_init__(self) -> None:
        if self.rounds < 0 or self.neighbourhood_px < 1 or self.smallest_px < 0:
            raise ValueRangeError(f"rounds and sizes must not be negative, got {self}")
        if self.prior_weight < 0.0 or self.blur_px < 0.0 or self.hole_px < 0:
            raise ValueRangeError(f"weights and sizes must not be negative, got {self}")


def sharpened(
    ids: NDArray[np.uint8],
    rgb: NDArray[np.uint8],
    palette: NDArray[np.float32],
    config: RefineConfig,
) -> NDArray[np.uint8]:
    """Return the map after the rounds of prior and likelihood.

    Args:
        ids: (H, W) uint8, the class of each window.
        rgb: (H, W, 3) uint8 of the same size.
        palette: (17, 32768) log-likelihoods.
        config: how to sharpen.

    Raises:
        ShapeError: map and image differ in size.
    """
    if ids.shape != rgb.shape[:2]:
        height, width = rgb.shape[:2]
        raise ShapeError("class ids", expected=f"{height}x{width}", actual=ids.shape)
    codes = colour_codes(rgb)
    present = np.unique(ids).tolist()
    likelihood = {class_id: _smoothed(palette[class_id][codes], config) for class_id in present}
    square = (config.neighbourhood_px, config.neighbourhood_px)
    for _ in range(config.rounds):
        best = np.full(ids.shape, -np.inf, dtype=np.float32)
        better_ids = ids.copy()
        for class_id in present:
            mask = (ids == class_id).astype(np.float32)
            share = cv2.boxFilter(mask, cv2.CV_32F, square, borderType=cv2.BORDER_REPLICATE)
            score = likelihood[class_id] + config.prior_weight * cv2.log(share + _MIN_SHARE)
            better = score > best
            np.copyto(best, score, where=better)
            np.putmask(better_ids, better, np.uint8(class_id))
        ids = better_ids
    return ids


def _smoothed(likelihood: NDArray[np.float32], config: RefineConfig) -> NDArray[np.float32]:
    if config.blur_px == 0.0:
        return likelihood
    return np.asarray(cv2.GaussianBlur(likelihood, (0, 0), config.blur_px), dtype=np.float32)
