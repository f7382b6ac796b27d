"""Rays onto the ground: a rectangle around the origin, or a polygon in it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from uav_bt.compiled import compiled
from uav_bt.lab.classes import OUTSIDE


@compiled(
    "void(float64[:, ::1], float64[:, :, ::1], Tuple((float64[::1], float64[:, ::1], int64,"
    " float64)), uint8[:, ::1], float32[:, ::1])"
)
def cast_ground(
    place: NDArray[np.float64],
    rays: NDArray[np.float64],
    ground: tuple[NDArray[np.float64], NDArray[np.float64], int, float],
    ids: NDArray[np.uint8],
    depth_m: NDArray[np.float32],
) -> None:
    """Fill a view with the ground, and with what lies outside.

    Args:
        place: (4, 3) position of the lens, optical axis, and right and down of the image.
        rays: (H, W, 2) right and down at unit depth.
        ground: (2,) half sizes of the ground along x and y, (E, 4) sides of its polygon (none: it
            is a rectangle), its class id, and the depth of what lies farther, m.
        ids: (H, W) filled with class ids.
        depth_m: (H, W) filled with depth along the optical axis, m.
    """
    half_m, edges, ground_id, far_m = ground
    for row in range(ids.shape[0]):
        for column in range(ids.shape[1]):
            u, v = rays[row, column]
            ids[row, column], depth_m[row, column] = OUTSIDE, far_m
            down = place[1, 2] + u * place[2, 2] + v * place[3, 2]
            if down < 0.0:
                depth = -place[0, 2] / down
                x_m = place[0, 0] + depth * (place[1, 0] + u * place[2, 0] + v * place[3, 0])
                y_m = place[0, 1] + depth * (place[1, 1] + u * place[2, 1] + v * place[3, 1])
                depth_m[row, column] = min(depth, far_m)
                inside = abs(x_m) <= half_m[0] and abs(y_m) <= half_m[1]
                if inside and len(edges):
                    inside = False
                    for side in range(len(edges)):  # even-odd rule, with a ray along x
                        ax, ay, ex, ey = edges[side]
                        if (ay > y_m) != (ay + ey > y_m) and x_m < ax + (y_m - ay) / ey * ex:
                            inside = not inside
                if inside:
                    ids[row, column] = ground_id
