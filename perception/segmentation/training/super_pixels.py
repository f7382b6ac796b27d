"""Super-pixels: small regions of an image whose borders follow the edges of objects.

A watershed from a regular grid of markers gives them (Machairas et al., Waterpixels, IEEE Trans.
Image Process. 2015), because OpenCV has SLIC only in its contributed modules.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from uav_bt.errors import ShapeError

MAX_WIDTH_PX: Final = 1152  # wider images are shrunk to it
_SIDE_SHARE: Final = 40.0 / MAX_WIDTH_PX  # side of a region in widths of the image
_MIN_SIDE_PX: Final = 4
_BLUR_PX: Final = 1.5  # standard deviation at the full width; noise makes ragged borders


@dataclass(frozen=True, kw_only=True, eq=False)
class SuperPixels:
    """The super-pixels of an image.

    Attributes:
        ids: (h, w) int32, the region of every pixel of the shrunk image, 0 to N - 1.
        innermost: (N, 2) int64, x and y of the pixel of each region that is farthest from its
            border, in the shrunk image.
        size_px: Width and height of the image.
    """

    ids: NDArray[np.int32]
    innermost: NDArray[np.int64]
    size_px: tuple[int, int]

    def at(self, x: int, y: int) -> int:
        """Return the region of a pixel of the image."""
        height, width = self.ids.shape
        column = int((x + 0.5) * width / self.size_px[0])
        row = int((y + 0.5) * height / self.size_px[1])
        return int(self.ids[row, column])

    def innermost_of(self, region: int) -> tuple[int, int]:
        """Return x and y of a region's innermost pixel, in the image."""
        height, width = self.ids.shape
        x, y = (self.innermost[region] + 0.5).tolist()
        return int(x * self.size_px[0] / width), int(y * self.size_px[1] / height)


def find_super_pixels(rgb: NDArray[np.uint8]) -> SuperPixels:
    """Divide an image into super-pixels of about 40 pixels at a width of 1152.

    Args:
        rgb: (H, W, 3) uint8.

    Raises:
        ShapeError: The image is not (H, W, 3).
    """
    if rgb.ndim != 3 or rgb.shape[2] != 3:
        raise ShapeError("image", expected="HxWx3", actual=rgb.shape)
    height, width = rgb.shape[:2]
    small = rgb
    if width > MAX_WIDTH_PX:
        size = (MAX_WIDTH_PX, max(1, round(height * MAX_WIDTH_PX / width)))
        small = np.asarray(cv2.resize(rgb, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)
    sigma = max(0.5, _BLUR_PX * small.shape[1] / MAX_WIDTH_PX)
    smooth = np.asarray(cv2.GaussianBlur(small, (0, 0), sigma), dtype=np.uint8)
    side = max(_MIN_SIDE_PX, round(_SIDE_SHARE * small.shape[1]))
    ids = _flooded(smooth, _markers(smooth, side))
    return SuperPixels(ids=ids, innermost=_innermost(ids), size_px=(width, height))


def _markers(smooth: NDArray[np.uint8], side: int) -> NDArray[np.int32]:
    """Return (h, w) int32 marks from 1 on: one in the middle half of each cell of the grid."""
    kernel = np.ones((3, 3), dtype=np.uint8)
    gradient = cv2.morphologyEx(smooth, cv2.MORPH_GRADIENT, kernel).max(axis=2)
    height, width = gradient.shape
    markers = np.zeros((height, width), dtype=np.int32)
    count = 0
    for top, bottom in _cells(height, side):
        for left, right in _cells(width, side):
            window = gradient[top:bottom, left:right]
            row, column = np.unravel_index(int(window.argmin()), window.shape)
            count += 1
            markers[top + row, left + column] = count
    return markers


def _cells(length: int, side: int) -> list[tuple[int, int]]:
    """Return begin and end of the middle half of each cell along an axis."""
    edges = np.linspace(0, length, max(1, round(length / side)) + 1)
    found = []
    for begin, end in pairwise(edges.tolist()):
        first = int(begin + 0.25 * (end - begin))
        found.append((first, max(first + 1, int(end - 0.25 * (end - begin)))))
    return found


def _flooded(smooth: NDArray[np.uint8], markers: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return the region of every pixel, from 0 on."""
    # The watershed marks the image's frame as border, too: a frame of one pixel is added.
    wide = cv2.copyMakeBorder(smooth, 1, 1, 1, 1, cv2.BORDER_REPLICATE)
    flooded = np.pad(markers, 1)
    cv2.watershed(wide, flooded)
    regions = flooded[1:-1, 1:-1].astype(np.float32)  # of float, because int32 is not dilated
    kernel = np.ones((3, 3), dtype=np.uint8)
    while (lines := regions < 1.0).any():
        regions[lines] = cv2.dilate(regions, kernel)[lines]
    return np.asarray(regions, dtype=np.int32) - 1


def _innermost(ids: NDArray[np.int32]) -> NDArray[np.int64]:
    """Return (N, 2) x and y of the pixel of each region with the largest distance to its border."""
    wide = np.pad(ids, 1, constant_values=-1)
    middle = wide[1:-1, 1:-1]
    inside = np.ones(ids.shape, dtype=bool)
    for neighbour in (wide[:-2, 1:-1], wide[2:, 1:-1], wide[1:-1, :-2], wide[1:-1, 2:]):
        inside &= neighbour == middle
    distance = cv2.distanceTransform(inside.astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    places = ndimage.maximum_position(distance, ids, np.arange(int(ids.max()) + 1))
    return np.array([(column, row) for row, column in places], dtype=np.int64)
