"""Choice of a video's images for training: sharp ones that differ from each other."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

import cv2
import numpy as np

from uav_bt.types.arrays import Flags, Floats32, Image

SHARPNESS_WIDTH_PX: Final = 320
_THUMBNAIL_PX: Final = (32, 18)
# Chosen on flights of the twin, where smooth views have a tenth of the median without any blur.
_LEAST_SHARP: Final = 0.2  # of the median of the video
_SHARPNESS_OF_NOTHING: Final = 4.0  # a wall out of focus; sharp images have 100 and more
_LEAST_CONTRAST: Final = 4.0  # standard deviation of the grey levels
_DARKEST: Final = 24.0  # grey level that a hundredth of the image must exceed
_LEAST_DISTANCE: Final = 0.2  # a correlation of 0.98


class Look(NamedTuple):
    """Measures of one image."""

    sharpness: float  # variance of the Laplacian at a width of 320 pixels
    blank: bool  # whether it is dark or of one colour
    # (576,), mean 0, standard deviation 1; zeros if all is of one colour
    thumbnail: Floats32


def look_at(grey: Image) -> Look:
    """Measure a grey image, (H, W); other widths than 320 are resized."""
    height_px, width_px = grey.shape
    size_px = sharpness_size_px(width_px, height_px)
    interpolation = cv2.INTER_AREA if width_px > size_px[0] else cv2.INTER_LINEAR
    grey = np.asarray(cv2.resize(grey, size_px, interpolation=interpolation), dtype=np.uint8)
    small = cv2.resize(grey, _THUMBNAIL_PX, interpolation=cv2.INTER_AREA).astype(np.float32)
    contrast = float(small.std())
    scale = 1.0 / contrast if contrast > 0.0 else 0.0
    return Look(
        sharpness=float(cv2.Laplacian(grey, cv2.CV_32F).var()),
        blank=float(grey.std()) < _LEAST_CONTRAST or float(np.percentile(grey, 99)) < _DARKEST,
        thumbnail=((small - small.mean()) * scale).astype(np.float32).ravel(),
    )


def sharpness_size_px(width_px: int, height_px: int) -> tuple[int, int]:
    """Return width and height of an image at the width at which sharpness is measured."""
    return SHARPNESS_WIDTH_PX, max(1, round(height_px * SHARPNESS_WIDTH_PX / width_px))


def clear_ones(looks: Sequence[Look]) -> Flags:
    """Return which images of one video, (N,), are neither blank nor much less sharp than others."""
    sharpness = np.array([look.sharpness for look in looks])
    seen = ~np.array([look.blank for look in looks], dtype=bool)
    if not seen.any():
        return seen
    least = max(_SHARPNESS_OF_NOTHING, _LEAST_SHARP * float(np.median(sharpness[seen])))
    return seen & (sharpness >= least)


def different_ones(looks: Sequence[Look]) -> list[int]:
    """Return the indices of images that differ, in the order of farthest-point selection.

    The sharpest image is first. Each further one is the image that differs most from the nearest
    chosen one. Images that are nearly the same as a chosen one are never taken.
    """
    if not looks:
        return []
    thumbnails = np.stack([look.thumbnail for look in looks])
    chosen = [int(np.argmax([look.sharpness for look in looks]))]
    nearest = np.full(len(looks), np.inf)
    while True:
        squared = (thumbnails - thumbnails[chosen[-1]]) ** 2
        nearest = np.minimum(nearest, np.sqrt(squared.mean(axis=1, dtype=np.float64)))
        if nearest.max() < _LEAST_DISTANCE:
            return chosen
        chosen.append(int(np.argmax(nearest)))
