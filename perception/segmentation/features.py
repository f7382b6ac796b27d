"""The teacher's features: hue, saturation and value histograms of square patches.

Mocanu et al. (arXiv 2510.16624, first level): a 40x40 patch in HSV becomes 90 hue, 64 saturation
and 36 value bins, concatenated to 190 numbers. They do not give the bin edges; ours, for OpenCV's
8-bit HSV, are: hue (0 to 179) in bins of two, saturation in bins of four, value ``v * 36 // 256``
(bins of seven or eight levels). Counts are divided by the patch's pixels, so each of the three
histograms sums to one for any patch size.

A patch determines the class well and the border badly; the colour of a single pixel does the
opposite. `palette_of_counts` gives the likelihood of each colour in each class, for
`clean.sharpened`.
"""

from __future__ import annotations

from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from uav_bt.errors import ValueRangeError
from uav_bt.types.arrays import Floats, Floats32, Image

_HUE, _SATURATION, _VALUE = 90, 64, 36  # bins
FEATURE_COUNT: Final = _HUE + _SATURATION + _VALUE

_LEVELS: Final = np.arange(256)
# Feature index of every 8-bit level of each channel. OpenCV never gives a hue above 179; the limit
# fills the rest of the table.
_HUE_BINS: Final = np.minimum(_LEVELS // 2, _HUE - 1)
_VALUE_BINS: Final = _HUE + _SATURATION + _LEVELS * _VALUE // 256
BIN_OF_LEVEL: Final = np.stack([_HUE_BINS, _HUE + _LEVELS // 4, _VALUE_BINS], axis=1)

_BITS: Final = 5  # of each of red, green, blue in a coarse colour; measured a little better than 4
_SIDE: Final = 1 << _BITS
COLOUR_COUNT: Final = _SIDE**3

_UNSEEN_SHARE: Final = 0.1  # probability spread evenly over all colours, for unseen ones


def hsv_of(rgb: Image) -> Image:
    """Return the 8-bit HSV image, (H, W, 3), of an RGB image."""
    return np.asarray(cv2.cvtColor(rgb, cv2.COLOR_RGB2HSV), dtype=np.uint8)


def patch_slices(
    x: int, y: int, *, patch_px: int, width_px: int, height_px: int
) -> tuple[slice, slice]:
    """Return rows and columns of the patch of a pixel.

    A patch of even size has no middle pixel: it starts ``patch_px // 2`` before its pixel. Near the
    image's border it is shifted inwards. ValueRangeError for a pixel outside the image.
    """
    if not (0 <= x < width_px and 0 <= y < height_px):
        raise ValueRangeError(f"pixel ({x}, {y}) lies outside the {width_px}x{height_px} image")
    left = min(max(x - patch_px // 2, 0), width_px - patch_px)
    top = min(max(y - patch_px // 2, 0), height_px - patch_px)
    return slice(top, top + patch_px), slice(left, left + patch_px)


class WindowMeans:
    """Means over all whole windows of planes of one size, with reused memory.

    New arrays of this size cost more time in page faults than the sums.
    """

    def __init__(self, *, width_px: int, height_px: int, side_px: int) -> None:
        self._side = side_px
        self._total = np.empty((height_px + 1, width_px + 1))
        self._inner = np.empty((height_px - side_px + 1, width_px - side_px + 1))

    def of(self, plane: Floats) -> Floats:
        """Return the means, (H - side + 1, W - side + 1), of a plane, (H, W).

        They are valid until the next call; the plane's mean is subtracted in place.
        """
        side, total, inner = self._side, self._total, self._inner
        # Without the mean, sums over the image and rounding errors stay small.
        mean = float(plane.mean())
        np.subtract(plane, mean, out=plane)
        cv2.integral(plane, total, sdepth=cv2.CV_64F)
        np.subtract(total[side:, side:], total[:-side, side:], out=inner)
        inner -= total[side:, :-side]
        inner += total[:-side, :-side]
        inner *= 1.0 / (side * side)
        inner += mean
        return inner


def spread_to_border(inner: NDArray[Any], side_px: int) -> NDArray[Any]:
    """Return values of whole windows, (H - side + 1, W - side + 1), as a map of all pixels, (H, W).

    They are placed as by `patch_slices`.
    """
    before, after = side_px // 2, side_px - 1 - side_px // 2
    return np.pad(inner, ((before, after), (before, after)), mode="edge")


def patch_features(hsv: Image, points: NDArray[np.int64], patch_px: int) -> Floats:
    """Return the normalised histograms, (N, 190), of the patches around points, (N, 2), x then y.

    Each row sums to three.
    """
    height_px, width_px = hsv.shape[:2]
    features = np.empty((len(points), FEATURE_COUNT))
    for row, (x, y) in enumerate(points.tolist()):
        patch = patch_slices(x, y, patch_px=patch_px, width_px=width_px, height_px=height_px)
        bins = BIN_OF_LEVEL[hsv[patch], np.arange(3)]
        features[row] = np.bincount(bins.ravel(), minlength=FEATURE_COUNT)
    return features / float(patch_px**2)


def colour_codes(rgb: Image) -> NDArray[np.uint16]:
    """Return the code (0 to 32767) of each pixel's coarse colour, for (..., 3) uint8 RGB."""
    coarse = (rgb >> (8 - _BITS)).astype(np.uint16)
    codes = coarse[..., 0] << (2 * _BITS) | coarse[..., 1] << _BITS | coarse[..., 2]
    return np.asarray(codes, dtype=np.uint16)


def palette_of_counts(counts: NDArray[np.int64]) -> Floats32:
    """Return the log-likelihood of each coarse colour in each class, (C, 32768), of pixel counts.

    Counts are spread to neighbouring colours, because a few thousand picks do not cover the
    variation of light and noise between images. A class without pixels gets a uniform one.
    """
    cube = counts.reshape(-1, _SIDE, _SIDE, _SIDE).astype(np.float64)
    for axis in (1, 2, 3):
        wide = np.pad(np.moveaxis(cube, axis, 0), [(1, 1), *3 * [(0, 0)]], mode="edge")
        cube = np.moveaxis(0.25 * wide[:-2] + 0.5 * wide[1:-1] + 0.25 * wide[2:], 0, axis)
    spread = cube.reshape(-1, COLOUR_COUNT)
    total = spread.sum(axis=1, keepdims=True)
    share = np.divide(spread, total, out=np.zeros_like(spread), where=total > 0.0)
    seen = np.where(total > 0.0, 1.0 - _UNSEEN_SHARE, 0.0)
    likelihood = seen * share + (1.0 - seen) / COLOUR_COUNT
    return np.asarray(np.log(likelihood), dtype=np.float32)
