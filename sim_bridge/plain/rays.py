"""Rays of a view onto ground, upright boxes and cylinders, and triangles.

A view is two arrays, class ids (H, W) and depth along the optical axis (H, W), m, which each kernel
fills where it is nearer. A camera is two arrays: the place (4, 3) of its lens, with the position,
the optical axis, and right and down of the image in the world; and focal lengths and middle (4,) of
the image, px. A pixel's ray is where it looks, right and down at unit depth.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from uav_bt.compiled import compiled
from uav_bt.lab.classes import OUTSIDE
from uav_bt.types.ground import Block

_MARGIN_PX: Final = 2.0  # of rays that look beside their pixel; chosen
_NEAR_M: Final = 0.05  # near plane: a corner with less depth has no place in the image; chosen
_EDGE: Final = 1e-9  # share of a triangle by which a ray may miss it, so that no gap shows

# Columns of the table of solids: place and half sizes, base and top, yaw, classes of the sides and
# of the middle of the top, side of that middle over the side of the top, and whether it is round.
X, Y, HALF_X, HALF_Y, BASE, TOP, COS, SIN, SIDE_ID, TOP_ID, SHARE, ROUND = range(12)
COLUMNS: Final = ROUND + 1


def solid_row(block: Block, side_id: int, top_id: int, share: float = 1.0) -> list[float]:
    """Return the row of a box or cylinder in the table of solids."""
    outline = block.footprint
    return [
        *(outline.x_m, outline.y_m, outline.half_x_m, outline.half_y_m),
        *(block.base_m, block.top_m, math.cos(outline.yaw_rad), math.sin(outline.yaw_rad)),
        *(side_id, top_id, share, float(outline.round)),
    ]


Camera = tuple[NDArray[np.float64], NDArray[np.float64]]


@compiled("UniTuple(float64, 3)(float64[:, ::1], float64, float64)")
def _direction(place: NDArray[np.float64], u: float, v: float) -> tuple[float, float, float]:
    """Return the direction of a pixel's ray in the world, of unit depth."""
    return (
        place[1, 0] + u * place[2, 0] + v * place[3, 0],
        place[1, 1] + u * place[2, 1] + v * place[3, 1],
        place[1, 2] + u * place[2, 2] + v * place[3, 2],
    )


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

    The ground has half sizes along x and y, (2,); the sides of its polygon, (E, 4), none of a
    rectangle; its class id; and the depth of what lies farther, m.
    """
    half_m, edges, ground_id, far_m = ground
    for row in range(ids.shape[0]):
        for column in range(ids.shape[1]):
            u, v = rays[row, column]
            ids[row, column], depth_m[row, column] = OUTSIDE, far_m
            x, y, z = _direction(place, u, v)
            if z >= 0.0:
                continue
            depth = -place[0, 2] / z
            x_m, y_m = place[0, 0] + depth * x, place[0, 1] + depth * y
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


@compiled("UniTuple(int64, 4)(float64[:, ::1], float64[::1], float64[:, ::1], UniTuple(int64, 2))")
def _image_bounds(
    place: NDArray[np.float64],
    lens: NDArray[np.float64],
    corners: NDArray[np.float64],
    size_px: tuple[int, int],
) -> tuple[int, int, int, int]:
    """Return the first row, row after the last, first column, column after the last of a body.

    They are those of the image, (rows, columns), that a convex body with corners (N, 3) may cover,
    with a margin for rays beside their pixels: no rows if the whole body is behind the lens or
    beside the view, all if only a corner is nearer than the near plane.
    """
    rows, columns = size_px
    low_u, high_u, low_v, high_v = np.inf, -np.inf, np.inf, -np.inf
    # The largest distance of a corner from the lens's plane and into the view from each side.
    ahead = from_left = from_right = from_top = from_bottom = -np.inf
    is_cut = False
    fx_px, fy_px, cx_px, cy_px = lens
    for corner in range(len(corners)):
        dx, dy, dz = corners[corner] - place[0]
        depth = place[1, 0] * dx + place[1, 1] * dy + place[1, 2] * dz
        right = fx_px * (place[2, 0] * dx + place[2, 1] * dy + place[2, 2] * dz)
        down = fy_px * (place[3, 0] * dx + place[3, 1] * dy + place[3, 2] * dz)
        ahead = max(ahead, depth)
        from_left = max(from_left, right + (cx_px + _MARGIN_PX) * depth)
        from_right = max(from_right, (columns - 1 + _MARGIN_PX - cx_px) * depth - right)
        from_top = max(from_top, down + (cy_px + _MARGIN_PX) * depth)
        from_bottom = max(from_bottom, (rows - 1 + _MARGIN_PX - cy_px) * depth - down)
        if depth < _NEAR_M:
            is_cut = True
            continue
        u, v = right / depth + cx_px, down / depth + cy_px
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


@compiled("void(float64[::1], float64[:, ::1])")
def _fill_corners(solid: NDArray[np.float64], corners: NDArray[np.float64]) -> None:
    """Fill in the corners of a solid, or of the box around a cylinder, (8, 3) world metres."""
    for corner in range(8):
        along = solid[HALF_X] if corner & 1 else -solid[HALF_X]
        across = solid[HALF_Y] if corner & 2 else -solid[HALF_Y]
        corners[corner, 0] = solid[X] + solid[COS] * along - solid[SIN] * across
        corners[corner, 1] = solid[Y] + solid[SIN] * along + solid[COS] * across
        corners[corner, 2] = solid[TOP] if corner & 4 else solid[BASE]


@compiled("Tuple((float64, boolean))(float64[::1], float64[::1], float64[::1])")
def _met(
    solid: NDArray[np.float64], origin_m: NDArray[np.float64], ray: NDArray[np.float64]
) -> tuple[float, bool]:
    """Return the depth at which a ray enters a solid, inf without a hit, and if by its top.

    The lens, (3,), and the ray, (3,) of unit depth, are in the solid's own axes.
    """
    half_m = solid[HALF_X : HALF_Y + 1]
    enter, leave = 0.0, np.inf
    if solid[ROUND]:
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
    base, roof = (solid[BASE] - origin_m[2]) / ray[2], (solid[TOP] - origin_m[2]) / ray[2]
    through_top = roof < base and roof >= enter
    enter = max(enter, min(base, roof))
    leave = min(leave, max(base, roof))
    return (enter, through_top) if 0.0 < enter <= leave else (np.inf, False)


@compiled(
    "void(Tuple((float64[:, ::1], float64[::1])), float64[:, :, ::1], float64[:, ::1],"
    " uint8[:, ::1], float32[:, ::1])"
)
def cast_solids(
    camera: Camera,
    rays: NDArray[np.float64],
    solids: NDArray[np.float64],
    ids: NDArray[np.uint8],
    depth_m: NDArray[np.float32],
) -> None:
    """Draw boxes and cylinders, rows (S, 12) of `solid_row`, where they are nearer than a view."""
    place, lens = camera
    origin_m, ray, corners = np.empty(3), np.empty(3), np.empty((8, 3))
    for index in range(len(solids)):
        solid = solids[index]
        cos, sin = solid[COS], solid[SIN]
        dx, dy = place[0, 0] - solid[X], place[0, 1] - solid[Y]
        origin_m[:] = cos * dx + sin * dy, cos * dy - sin * dx, place[0, 2]
        _fill_corners(solid, corners)
        first_row, end_row, first, end = _image_bounds(place, lens, corners, ids.shape)
        for row in range(first_row, end_row):
            for column in range(first, end):
                u, v = rays[row, column]
                x, y, z = _direction(place, u, v)
                ray[0], ray[1], ray[2] = cos * x + sin * y, cos * y - sin * x, z
                depth, in_middle = _met(solid, origin_m, ray)
                if depth >= depth_m[row, column]:
                    continue
                depth_m[row, column] = depth
                for axis in range(2):
                    met_m = origin_m[axis] + depth * ray[axis]
                    in_middle = in_middle and abs(met_m) <= solid[SHARE] * solid[HALF_X + axis]
                ids[row, column] = solid[TOP_ID] if in_middle else solid[SIDE_ID]


@compiled(
    "void(Tuple((float64[:, ::1], float64[::1])), float64[:, :, ::1], Tuple((float64[:, :, ::1],"
    " uint8[::1])), uint8[:, ::1], float32[:, ::1])"
)
def cast_triangles(
    camera: Camera,
    rays: NDArray[np.float64],
    meshes: tuple[NDArray[np.float64], NDArray[np.uint8]],
    ids: NDArray[np.uint8],
    depth_m: NDArray[np.float32],
) -> None:
    """Draw triangles where they are nearer than a view (Moeller and Trumbore).

    They are corners (N, 3, 3), world metres, and class ids (N,).
    """
    (place, lens), (triangles, classes) = camera, meshes
    for index in range(len(triangles)):
        corners = triangles[index]
        first_row, end_row, first, end = _image_bounds(place, lens, corners, ids.shape)
        ax, ay, az = corners[1] - corners[0]
        bx, by, bz = corners[2] - corners[0]
        tx, ty, tz = place[0] - corners[0]
        qx, qy, qz = ty * az - tz * ay, tz * ax - tx * az, tx * ay - ty * ax
        scaled_depth = bx * qx + by * qy + bz * qz
        for row in range(first_row, end_row):
            for column in range(first, end):
                u, v = rays[row, column]
                x, y, z = _direction(place, u, v)
                px, py, pz = y * bz - z * by, z * bx - x * bz, x * by - y * bx
                determinant = ax * px + ay * py + az * pz
                if determinant == 0.0:
                    continue  # the ray lies in the plane of the triangle
                along_a = (tx * px + ty * py + tz * pz) / determinant
                along_b = (x * qx + y * qy + z * qz) / determinant
                depth = scaled_depth / determinant
                if min(along_a, along_b, 1.0 - along_a - along_b) < -_EDGE or depth <= 0.0:
                    continue
                if depth < depth_m[row, column]:
                    depth_m[row, column] = depth
                    ids[row, column] = classes[index]
