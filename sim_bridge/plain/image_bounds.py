"""The part of an image that a body may cover."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from uav_bt.compiled import compiled

_MARGIN_PX: Final = 2.0  # of rays that look beside their pixel; chosen
_NEAR_M: Final = 0.05  # near plane: a corner with less depth has no place in the image; chosen


@compiled("UniTuple(int64, 4)(float64[:, ::1], float64[::1], float64[:, ::1], UniTuple(int64, 2))")
def image_bounds(
    place: NDArray[np.float64],
    lens: NDArray[np.float64],
    corners: NDArray[np.float64],
    size_px: tuple[int, int],
) -> tuple[int, int, int, int]:
    """Return the rows and columns of the image that a convex body may cover.

    Args:
        place: (4, 3) position of the lens, optical axis, and right and down of the image.
        lens: (4,) focal lengths and middle, px.
        corners: (N, 3) corners of the body, world metres.
        size_px: rows and columns of the image.

    Returns:
        First row, row after the last, first column, column after the last, with a margin for rays
        beside their pixels. No rows if the whole body is behind the lens or beside the view; all
        if only a corner is nearer than the near plane or behind the lens.
    """
    rows, columns = size_px
    low_u, high_u, low_v, high_v = np.inf, -np.inf, np.inf, -np.inf
    # The largest distance of a corner from the lens's plane and into the view from each side.
    ahead = from_left = from_right = from_top = from_bottom = -np.inf
    is_cut = False
    for corner in range(len(corners)):
        dx = corners[corner, 0] - place[0, 0]
        dy = corners[corner, 1] - place[0, 1]
        dz = corners[corner, 2] - place[0, 2]
        depth = place[1, 0] * dx + place[1, 1] * dy + place[1, 2] * dz
        right = lens[0] * (place[2, 0] * dx + place[2, 1] * dy + place[2, 2] * dz)
        down = lens[1] * (place[3, 0] * dx + place[3, 1] * dy + place[3, 2] * dz)
        ahead = max(ahead, depth)
        from_left = max(from_left, right + (lens[2] + _MARGIN_PX) * depth)
        from_right = max(from_right, (columns - 1 + _MARGIN_PX - lens[2]) * depth - right)
        from_top = max(from_top, down + (lens[3] + _MARGIN_PX) * depth)
        from_bottom = max(from_bottom, (rows - 1 + _MARGIN_PX - lens[3]) * depth - down)
        if depth < _NEAR_M:
            is_cut = True
            continue
        u, v = right / depth + lens[2], down / depth + lens[3]
        low_u, high_u = min(low_u, u), max(high_u, u)
        low_v, high_v = min(low_v, v), max(high_v, v)
    if min(ahead, from_left, from_right, from_top, from_bottom) < 0.0:
        return 0, 0, 0, 0
    if is_cut:
        return 0, rows, 0, columns
    return (
        math.ceil(max(low_v - _MARGIN_PX, 0.0)),
        math.floor(min(high_v + _MARGIN_PX, rows - 1.0)) + 1,
        math.ceil(max(low_u - _MARGIN_PX, 0.0)),
        math.floor(min(high_u + _MARGIN_PX, columns - 1.0)) + 1,
    )
