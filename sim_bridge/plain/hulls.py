"""Convex hulls of meshes as facets, and the point of a hull that is nearest to a point."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from uav_bt.compiled import compiled
from uav_bt.errors import InputError


def facets_of(points_m: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the facets of the convex hull of points.

    Args:
        points_m: (N, 3) points.

    Returns:
        (F, 4, 3) three corners, m, and the outward normal of each triangle.

    Raises:
        InputError: The points lie in a plane.
    """
    try:
        hull = ConvexHull(points_m)
    except QhullError as error:
        raise InputError(
            "a piece of a mesh or of the ground is flat and cannot be touched: give it an extent "
            "along x, y and z"
        ) from error
    corners, normals = hull.points[hull.simplices], hull.equations[:, None, :3]
    return np.ascontiguousarray(np.concatenate([corners, normals], axis=1))


@compiled("UniTuple(float64, 3)(float64[:, ::1], UniTuple(float64, 3), float64, float64)")
def _along(
    facet: NDArray[np.float64], point: tuple[float, float, float], first: float, second: float
) -> tuple[float, float, float]:
    """Return the way from a point to a + first (b - a) + second (c - a) of a triangle a, b, c."""
    a, b, c = facet[0], facet[1], facet[2]
    return (
        a[0] + first * (b[0] - a[0]) + second * (c[0] - a[0]) - point[0],
        a[1] + first * (b[1] - a[1]) + second * (c[1] - a[1]) - point[1],
        a[2] + first * (b[2] - a[2]) + second * (c[2] - a[2]) - point[2],
    )


@compiled("UniTuple(float64, 3)(float64[:, ::1], UniTuple(float64, 3))")
def _to_triangle(
    facet: NDArray[np.float64], point: tuple[float, float, float]
) -> tuple[float, float, float]:
    """Return the way from a point to the nearest point of a triangle (Ericson, 5.1.5)."""
    a, b, c = facet[0], facet[1], facet[2]
    d1 = d2 = d3 = d4 = d5 = d6 = 0.0  # of the point from a, b and c, along b - a and c - a
    for axis in range(3):
        ab, ac = b[axis] - a[axis], c[axis] - a[axis]
        d1 += ab * (point[axis] - a[axis])
        d2 += ac * (point[axis] - a[axis])
        d3 += ab * (point[axis] - b[axis])
        d4 += ac * (point[axis] - b[axis])
        d5 += ab * (point[axis] - c[axis])
        d6 += ac * (point[axis] - c[axis])
    at_a, at_b, at_c = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2
    first, second = 0.0, 0.0
    if d1 <= 0.0 and d2 <= 0.0:
        pass
    elif d3 >= 0.0 and d4 <= d3:
        first = 1.0
    elif d6 >= 0.0 and d5 <= d6:
        second = 1.0
    elif at_c <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        first = d1 / (d1 - d3)
    elif at_b <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        second = d2 / (d2 - d6)
    elif at_a <= 0.0 and d4 >= d3 and d5 >= d6:
        second = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        first = 1.0 - second
    else:
        whole = at_a + at_b + at_c
        first, second = at_b / whole, at_c / whole
    return _along(facet, point, first, second)


@compiled("float64(float64[:, ::1], UniTuple(float64, 3))")
def _above(facet: NDArray[np.float64], point: tuple[float, float, float]) -> float:
    """Return the height of a point above the plane of a facet."""
    height = 0.0
    for axis in range(3):
        height += facet[3, axis] * (point[axis] - facet[0, axis])
    return height


@compiled("UniTuple(float64, 3)(float64[:, :, ::1], UniTuple(float64, 3))")
def nearest_of_hull(
    facets: NDArray[np.float64], point: tuple[float, float, float]
) -> tuple[float, float, float]:
    """Return the point of a hull that is nearest to a point.

    Args:
        facets: (F, 4, 3) of `facets_of`.
        point: the point, in the same axes.
    """
    nearest, dx, dy, dz = np.inf, 0.0, 0.0, 0.0
    for index in range(len(facets)):
        if not 0.0 < _above(facets[index], point) < nearest:
            continue  # the point is behind this facet, or another one is nearer than its plane
        x, y, z = _to_triangle(facets[index], point)
        away = math.sqrt(x * x + y * y + z * z)
        if away < nearest:
            nearest, dx, dy, dz = away, x, y, z
    return point[0] + dx, point[1] + dy, point[2] + dz


@compiled("UniTuple(float64, 3)(float64[:, :, ::1], UniTuple(float64, 3))")
def way_out_of_hull(
    facets: NDArray[np.float64], point: tuple[float, float, float]
) -> tuple[float, float, float]:
    """Return the normal of the facet of a hull that is nearest to a point in it.

    Args:
        facets: (F, 4, 3) of `facets_of`.
        point: the point, in the same axes.
    """
    best, highest = 0, -np.inf
    for index in range(len(facets)):
        height = _above(facets[index], point)
        if height > highest:
            best, highest = index, height
    return facets[best, 3, 0], facets[best, 3, 1], facets[best, 3, 2]
