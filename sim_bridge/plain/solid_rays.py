"""Rays onto upright boxes and cylinders."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sim_bridge.plain.image_bounds import image_bounds
from uav_bt.compiled import compiled

RAY_COLUMNS: Final = 12  # of the table of solids


def solid_row(
    outline: tuple[tuple[float, float], tuple[float, float, float], float],
    class_ids: tuple[int, int],
    share: float = 1.0,
    *,
    is_round: bool = False,
    base_m: float = 0.0,
) -> list[float]:
    """Return the row of a solid in the kernel's table.

    Args:
        outline: its centre, world x and y, m; its size along its x and y, and the height of its
            top, m; its yaw, degrees counter-clockwise.
        class_ids: classes of its sides and of the middle of its top.
        share: side of that middle over the side of the top; the rest has the class of the sides.
        is_round: whether it is a cylinder.
        base_m: height of its underside.
    """
    position_m, (length_m, width_m, height_m), yaw_deg = outline
    cos, sin = math.cos(math.radians(yaw_deg)), math.sin(math.radians(yaw_deg))
    sizes_m = length_m / 2, width_m / 2, height_m
    return [*position_m, *sizes_m, cos, sin, *class_ids, share, float(is_round), base_m]


@compiled("void(float64[::1], float64[:, ::1])")
def _fill_corners(solid: NDArray[np.float64], corners: NDArray[np.float64]) -> None:
    """Fill in the corners of a solid, or of the box around a cylinder, (8, 3) world metres."""
    x_m, y_m, half_x, half_y, high_m, cos, sin = solid[:7]
    for corner in range(8):
        along = half_x if corner & 1 else -half_x
        across = half_y if corner & 2 else -half_y
        corners[corner, 0] = x_m + cos * along - sin * across
        corners[corner, 1] = y_m + sin * along + cos * across
        corners[corner, 2] = high_m if corner & 4 else solid[11]


@compiled("Tuple((float64, boolean))(float64[::1], float64[::1], float64[::1])")
def _met(
    solid: NDArray[np.float64], origin_m: NDArray[np.float64], ray: NDArray[np.float64]
) -> tuple[float, bool]:
    """Return the depth at which a ray enters a solid, and whether through its top.

    Args:
        solid: (12,) row of `solid_row`.
        origin_m: (3,) the lens in the solid's own axes, from the middle of its base.
        ray: (3,) of unit depth, in the same axes.

    Returns:
        Depth along the optical axis, m, inf without a hit; whether the top was hit.
    """
    half_m, high_m = solid[2:4], solid[4]
    enter, leave = 0.0, np.inf
    if solid[10]:  # a cylinder
        square = ray[0] * ray[0] + ray[1] * ray[1]
        along = origin_m[0] * ray[0] + origin_m[1] * ray[1]
        beyond = origin_m[0] * origin_m[0] + origin_m[1] * origin_m[1] - half_m[0] * half_m[0]
        root = along * along - square * beyond
        if root < 0.0:
            return np.inf, False
        enter, leave = (-along - math.sqrt(root)) / square, (-along + math.sqrt(root)) / square
    else:
        for axis in range(2):
            near = (-half_m[axis] - origin_m[axis]) / ray[axis]
            far = (half_m[axis] - origin_m[axis]) / ray[axis]
            enter, leave = max(enter, min(near, far)), min(leave, max(near, far))
    base, roof = (solid[11] - origin_m[2]) / ray[2], (high_m - origin_m[2]) / ray[2]
    through_top = roof < base and roof >= enter
    enter = max(enter, min(base, roof))
    leave = min(leave, max(base, roof))
    return (enter, through_top) if 0.0 < enter <= leave else (np.inf, False)


@compiled(
    "void(Tuple((float64[:, ::1], float64[::1])), float64[:, :, ::1], float64[:, ::1],"
    " uint8[:, ::1], float32[:, ::1])"
)
def cast_solids(
    camera: tuple[NDArray[np.float64], NDArray[np.float64]],
    rays: NDArray[np.float64],
    solids: NDArray[np.float64],
    ids: NDArray[np.uint8],
    depth_m: NDArray[np.float32],
) -> None:
    """Draw boxes and cylinders into a view, where they are nearer than its depth.

    Args:
        camera: (4, 3) position of the lens, optical axis, and right and down of the image; and
            (4,) focal lengths and middle, px.
        rays: (H, W, 2) right and down at unit depth.
        solids: (S, 12) rows of `solid_row`.
        ids: (H, W) class ids.
        depth_m: (H, W) depth along the optical axis, m.
    """
    place, lens = camera
    origin_m, ray, corners = np.empty(3), np.empty(3), np.empty((8, 3))
    for index in range(len(solids)):
        solid = solids[index]
        cos, sin = solid[5], solid[6]
        dx, dy = place[0, 0] - solid[0], place[0, 1] - solid[1]
        origin_m[:] = cos * dx + sin * dy, cos * dy - sin * dx, place[0, 2]
        _fill_corners(solid, corners)
        first_row, end_row, first_column, end_column = image_bounds(place, lens, corners, ids.shape)
        for row in range(first_row, end_row):
            for column in range(first_column, end_column):
                u, v = rays[row, column]
                x = place[1, 0] + u * place[2, 0] + v * place[3, 0]
                y = place[1, 1] + u * place[2, 1] + v * place[3, 1]
                z = place[1, 2] + u * place[2, 2] + v * place[3, 2]
                ray[0], ray[1], ray[2] = cos * x + sin * y, cos * y - sin * x, z
                depth, through_top = _met(solid, origin_m, ray)
                if depth >= depth_m[row, column]:
                    continue
                depth_m[row, column] = depth
                middle = through_top
                for axis in range(2):
                    met_m = origin_m[axis] + depth * ray[axis]
                    middle = middle and abs(met_m) <= solid[9] * solid[2 + axis]
                ids[row, column] = solid[8] if middle else solid[7]
