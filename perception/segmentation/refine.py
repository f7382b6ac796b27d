"""Sharper borders for the teacher: the windows say which classes are near, the pixels where.

A 40-pixel window puts a class's border up to 20 pixels off, and the student would learn it so. This
step is ours, not the paper's, and can be left out. For every pixel it weighs, in the manner of
Bayes, two things: how much of the neighbourhood the windows gave to a class (the prior), and how
well the class's palette explains the pixels right here (the likelihood). The result is a better
prior, so a few rounds follow one another. At the end, holes in a box's side are filled: a grey
square of its pattern is not a view through it.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.segmentation.clean import drop_small_components, filled_holes
from perception.segmentation.palette import colour_codes
from perception.segmentation.teacher import Teacher
from uav_bt.classes import HELIPAD_H, OBSTACLES
from uav_bt.errors import ShapeError, ValueRangeError

_MIN_SHARE = 1e-4  # of the neighbourhood; keeps the prior's logarithm finite


@dataclass(frozen=True, kw_only=True)
class RefineConfig:
    """How borders are sharpened; pixels are those of the teacher's 1152x648 image.

    The numbers were chosen on the validation scenes.
    """

    rounds: int = 3  # 0 leaves the windows' vote as it is
    neighbourhood_px: int = 41  # side of the square the prior is counted in; about a patch
    prior_weight: float = 3.0  # of the prior's logarithm; neighbouring pixels are not independent
    blur_px: float = 1.0  # standard deviation of the likelihood's smoothing; evens out image noise
    smallest_px: int = 100  # area; smaller pieces are noise
    hole_px: int = 4000  # area; smaller holes in a box's side are its pattern

    def __post_init__(self) -> None:
        if self.rounds < 0 or self.neighbourhood_px < 1 or self.smallest_px < 0:
            raise ValueRangeError(f"rounds and sizes must not be negative, got {self}")
        if self.prior_weight < 0.0 or self.blur_px < 0.0 or self.hole_px < 0:
            raise ValueRangeError(f"weights and sizes must not be negative, got {self}")


def refined_ids(
    teacher: Teacher, rgb: NDArray[np.uint8], config: RefineConfig
) -> NDArray[np.uint8]:
    """Return the teacher's class map with sharp borders.

    Args:
        teacher: with a palette.
        rgb: (H, W, 3) uint8, at the teacher's size.
        config: how to sharpen.

    Returns:
        (H, W) uint8 class ids.

    Raises:
        ValueRangeError: the teacher has no palette.
    """
    ids = teacher.window_ids(rgb)
    if config.rounds == 0:
        return ids
    if teacher.palette is None:
        raise ValueRangeError("this teacher has no palette to sharpen with; train it anew")
    ids = sharpened(ids, rgb, teacher.palette, config)
    ids = drop_small_components(ids, area_px=config.smallest_px)
    # An H lies inside the striped frame, and a thing before the carpet or the wall is no hole.
    return filled_holes(ids, inside=OBSTACLES, but=(HELIPAD_H,), area_px=config.hole_px)


def sharpened(
    ids: NDArray[np.uint8],
    rgb: NDArray[np.uint8],
    palette: NDArray[np.float32],
    config: RefineConfig,
) -> NDArray[np.uint8]:
    """Return the map after the rounds of prior and likelihood.

    Args:
        ids: (H, W) uint8, the windows' vote.
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
