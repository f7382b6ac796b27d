"""Compiled loops over the pixels of a safety corridor.

They are imported late, because commands that fly nothing must not wait for Numba.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from uav_bt.compiled import compiled
from uav_bt.types.arrays import Flags, Floats32, Indices

Seen = tuple[Indices, Floats32, Floats32, Floats32, int, int]


@compiled("Tuple((float32[:, ::1], uint8[:, ::1]))(float32[:, :, ::1], float32[::1], float32)")
def exits(
    rays: NDArray[np.float32], distances_m: NDArray[np.float32], min_m: np.float32
) -> tuple[NDArray[np.float32], NDArray[np.uint8]]:
    """Find the nearest plane that each ray crosses.

    Args:
        rays: (3, H, W) rays of unit depth: forward, right, down.
        distances_m: (5,) distances of the planes from the lens, in the order of SIDES.
        min_m: planes at this depth or nearer do not count.

    Returns:
        (H, W) depth of the crossing, inf without one; (H, W) index into SIDES.
    """
    shape = rays.shape[1:]
    depth_m, side = np.full(shape, np.float32(np.inf)), np.zeros(shape, dtype=np.uint8)
    for row in range(shape[0]):
        for column in range(shape[1]):
            for index in range(5):
                axis = 1 if index < 2 else 0 if index == 2 else 2
                towards = rays[axis, row, column]
                towards = -towards if index in (0, 3) else towards
                if towards > np.float32(1e-6):
                    crossed_m = distances_m[index] / towards
                    if min_m < crossed_m < depth_m[row, column]:
                        depth_m[row, column], side[row, column] = crossed_m, index
    return depth_m, side


@compiled(
    "Tuple((intp[::1], float32[::1], float32[::1], float32[::1], int64, int64))"
    "(Array(float32, 1, 'C', readonly=True), Array(float32, 1, 'C', readonly=True),"
    " Array(boolean, 1, 'C', readonly=True), float32[:, ::1], float32[::1], float32[::1])"
)
def intrusions(  # noqa: PLR0917 - Numba passes arguments by position
    depth_m: Floats32,
    bounds_m: Floats32,
    counts: Flags,
    rays: Floats32,
    exits_m: Floats32,
    walls_m: Floats32,
) -> Seen:
    """Find the pixels inside the corridor, and those ahead of the centre between its walls.

    Args:
        depth_m: (P,) depth of each pixel, not finite where unknown.
        bounds_m: (P,) upper bounds of the depth.
        counts: (P,) pixels that count.
        rays: (3, P) rays of unit depth: forward, right, down.
        exits_m: (P,) depth at which the rays leave the corridor.
        walls_m: (5,) left, right, upper and lower wall from the lens along right and down, and the
            lens ahead of the centre.

    Returns:
        (N,) pixels inside; (N,) their range from the centre; (N,) their position to the right;
        (K,) distance ahead of the pixels between the walls; the number of pixels inside whose depth
        is unknown; the number of pixels whose depth is unknown.
    """
    left_m, right_m, up_m, down_m, offset_m = walls_m
    found = np.empty(len(depth_m), dtype=np.intp)
    ranges_m, across_m = np.empty_like(depth_m), np.empty_like(depth_m)
    ahead_m = np.empty_like(depth_m)
    inside, ahead, unseen, unknown = 0, 0, 0, 0
    for pixel in range(len(depth_m)):
        if not counts[pixel]:
            continue
        forward, right, down = rays[0, pixel], rays[1, pixel], rays[2, pixel]
        metres, bound = depth_m[pixel], bounds_m[pixel]
        is_known = np.isfinite(metres)
        if is_known:
            bound = metres if not bound < metres else bound
            x, y, z = metres * forward + offset_m, metres * right, metres * down
            if x > 0.0 and left_m <= y <= right_m and up_m <= z <= down_m:
                ahead_m[ahead] = x
                ahead += 1
        else:
            unknown += 1
        if (metres if is_known else bound) < exits_m[pixel]:
            unseen += not is_known
            x, y, z = bound * forward + offset_m, bound * right, bound * down
            found[inside], across_m[inside] = pixel, y
            ranges_m[inside] = np.sqrt(x * x + y * y + z * z)
            inside += 1
    return found[:inside], ranges_m[:inside], across_m[:inside], ahead_m[:ahead], unseen, unknown
