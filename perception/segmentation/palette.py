"""How likely each colour is in each class, counted from the same picks that train the teacher.

The paper's teacher votes with whole windows, which is sure of the class and vague about the border.
A pixel's own colour is the other way round; `refine` combines the two.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from uav_bt.classes import CLASS_COUNT
from uav_bt.errors import ShapeError, ValueRangeError

_BITS: Final = 5  # of each of red, green, blue; measured a little better than four
_SIDE: Final = 1 << _BITS
COLOUR_COUNT: Final = _SIDE**3

_UNSEEN_SHARE: Final = 0.1  # of a pixel's chance goes to colours no pick showed, evenly


def colour_codes(rgb: NDArray[np.uint8]) -> NDArray[np.uint16]:
    """Return the code (0 to 32767) of each pixel's coarse colour, for (..., 3) uint8 RGB."""
    if rgb.shape[-1] != 3:
        raise ShapeError("image", expected="HxWx3", actual=rgb.shape)
    if rgb.dtype != np.uint8:
        raise ValueRangeError(f"an image must be uint8, got {rgb.dtype}")
    coarse = (rgb >> (8 - _BITS)).astype(np.uint16)
    codes = coarse[..., 0] << (2 * _BITS) | coarse[..., 1] << _BITS | coarse[..., 2]
    return np.asarray(codes, dtype=np.uint16)


def count_colours(rgb: NDArray[np.uint8]) -> NDArray[np.int64]:
    """Return how often each coarse colour occurs, (32768,)."""
    return np.bincount(colour_codes(rgb).ravel(), minlength=COLOUR_COUNT)


def palette_of_counts(counts: NDArray[np.int64]) -> NDArray[np.float32]:
    """Return the log-likelihood of each coarse colour in each class.

    Counts are spread to neighbouring colours, because light and noise differ from image to
    image more than a few thousand picks can show.

    Args:
        counts: (17, 32768) pixels by class and colour.

    Returns:
        (17, 32768) float32, natural logarithms; a class without pixels likes all colours alike.
    """
    if counts.shape != (CLASS_COUNT, COLOUR_COUNT):
        raise ShapeError("counts", expected=f"17x{COLOUR_COUNT}", actual=counts.shape)
    cube = counts.reshape(CLASS_COUNT, _SIDE, _SIDE, _SIDE).astype(np.float64)
    for axis in (1, 2, 3):
        padding = [(1, 1) if other == axis else (0, 0) for other in range(4)]
        wide = np.moveaxis(np.pad(cube, padding, mode="edge"), axis, 0)
        cube = np.moveaxis(0.25 * wide[:-2] + 0.5 * wide[1:-1] + 0.25 * wide[2:], 0, axis)
    spread = cube.reshape(CLASS_COUNT, COLOUR_COUNT)
    total = spread.sum(axis=1, keepdims=True)
    share = np.divide(spread, total, out=np.zeros_like(spread), where=total > 0.0)
    seen = np.where(total > 0.0, 1.0 - _UNSEEN_SHARE, 0.0)
    likelihood = seen * share + (1.0 - seen) / COLOUR_COUNT
    return np.asarray(np.log(likelihood), dtype=np.float32)
