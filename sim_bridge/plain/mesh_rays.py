"""Rays onto the triangles of meshes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sim_bridge.plain.image_bounds import image_bounds
from uav_bt.compiled import compiled

_EDGE = 1e-9  # share of a triangle by which a ray may miss it, so that no gap shows at an edge


@compiled(
    "void(Tuple((float64[:, ::1], float64[::1])), float64[:, :, ::1], Tuple((float64[:, :, ::1],"
    " uint8[::1])), uint8[:, ::1], float32[:, ::1])"
)
def cast_triangles(
    camera: tuple[NDArray[np.float64], NDArray[np.float64]],
    rays: NDArray[np.float64],
    meshes: tuple[NDArray[np.float64], NDArray[np.uint8]],
    ids: NDArray[np.uint8],
    depth_m: NDArray[np.float32],
) -> None:
    """Draw triangles into a view, where they are nearer than its depth (Moeller and Trumbore).

    Args:
        camera: (4, 3) position of the lens, optical axis, and right and down of the image; and
            (4,) focal lengths and middle, px.
        rays: (H, W, 2) right and down at unit depth.
        meshes: (N, 3, 3) corners, world metres, and (N,) class ids.
        ids: (H, W) class ids.
        depth_m: (H, W) depth along the optical axis, m.
    """
    (place, lens), (triangles, classes) = camera, meshes
    for index in range(len(triangles)):
        corners = triangles[index]
        first_row, end_row, first_column, end_column = image_bounds(place, lens, corners, ids.shape)
        ax, ay, az = corners[1] - corners[0]
        bx, by, bz = corners[2] - corners[0]
        tx, ty, tz = place[0] - corners[0]
        qx, qy, qz = ty * az - tz * ay, tz * ax - tx * az, tx * ay - ty * ax
        scaled_depth = bx * qx + by * qy + bz * qz
        for row in range(first_row, end_row):
            for column in range(first_column, end_column):
                u, v = rays[row, column]
                x = place[1, 0] + u * place[2, 0] + v * place[3, 0]
                y = place[1, 1] + u * place[2, 1] + v * place[3, 1]
                z = place[1, 2] + u * place[2, 2] + v * place[3, 2]
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
