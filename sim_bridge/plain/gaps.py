"""Distances from the drone's hull, a tilted box, to upright boxes and cylinders, and to meshes.

The nearest points of two convex solids minimise a convex function. Projected gradient steps with
Nesterov's momentum find them, because the nearest point of a box, a cylinder or the convex hull of
a mesh is known in closed form. The plane between two such points bounds the distance from below,
so that the error is known.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sim_bridge.plain.hulls import nearest_of_hull, way_out_of_hull
from uav_bt.compiled import compiled

GAP_COLUMNS: Final = 11
"""Columns of a table of solids: world x and y of the axis, half sizes along the solid's x and y,
height of its bottom and top, cosine and sine of its yaw, 1 for a cylinder; metres. Then the first
facet of a hull and the number of its facets, 0 for boxes and cylinders; the sizes of a hull are
those of the box around it."""

Table = tuple[NDArray[np.float64], NDArray[np.float64]]
"""A table of solids, (S, GAP_COLUMNS), and the facets of their hulls, (F, 4, 3)."""

_TOLERANCE_M: Final = 1e-5  # error of a distance
_TOUCH_M: Final = 1e-9  # nearer solids overlap
_STEPS: Final = 2000  # most steps; few take more than 50


@compiled("void(float64[::1], float64[:, ::1])")
def _orient(pose: NDArray[np.float64], hull: NDArray[np.float64]) -> None:
    """Fill (4, 3) with the centre and the forward, left and up axes of a pose.

    Args:
        pose: (6,) world x, y and z, m; roll, pitch (nose-up) and yaw, rad.
        hull: (4, 3) filled.
    """
    cr, sr = math.cos(pose[3]), math.sin(pose[3])
    cp, sp = math.cos(pose[4]), math.sin(pose[4])
    cy, sy = math.cos(pose[5]), math.sin(pose[5])
    hull[0, 0], hull[0, 1], hull[0, 2] = pose[0], pose[1], pose[2]
    hull[1, 0], hull[1, 1], hull[1, 2] = cy * cp, sy * cp, sp
    hull[2, 0], hull[2, 1], hull[2, 2] = -cy * sp * sr - sy * cr, -sy * sp * sr + cy * cr, cp * sr
    hull[3, 0], hull[3, 1], hull[3, 2] = -cy * sp * cr + sy * sr, -sy * sp * cr - cy * sr, cp * cr


@compiled("UniTuple(float64, 3)(float64[::1], float64, float64, float64)")
def _nearest_upright(
    solid: NDArray[np.float64], x: float, y: float, z: float
) -> tuple[float, float, float]:
    """Return the nearest point of a cylinder, or of the box around another solid."""
    z = min(max(z, solid[4]), solid[5])
    if solid[8]:
        away = math.hypot(x, y)
        share = min(1.0, solid[2] / away) if away > 0.0 else 1.0
        return x * share, y * share, z
    return min(max(x, -solid[2]), solid[2]), min(max(y, -solid[3]), solid[3]), z


@compiled("UniTuple(float64, 3)(float64[::1], float64[:, :, ::1], float64, float64, float64)")
def _nearest(
    solid: NDArray[np.float64], facets: NDArray[np.float64], x: float, y: float, z: float
) -> tuple[float, float, float]:
    """Return the point of a solid that is nearest to a point, both in the solid's axes."""
    if len(facets):
        return nearest_of_hull(facets, (x, y, z))
    return _nearest_upright(solid, x, y, z)


@compiled("float64[:, :, ::1](float64[::1], float64[:, :, ::1])")
def _own_facets(solid: NDArray[np.float64], facets: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the facets of a solid; none of a box or cylinder."""
    first = int(solid[9])
    return facets[first : first + int(solid[10])]


@compiled("UniTuple(float64, 3)(float64[:, ::1], float64[::1])")
def _point(own: NDArray[np.float64], at: NDArray[np.float64]) -> tuple[float, float, float]:
    """Return a point of a box in the axes of `own`, from its place in the box's axes."""
    return (
        own[0, 0] + at[0] * own[1, 0] + at[1] * own[2, 0] + at[2] * own[3, 0],
        own[0, 1] + at[0] * own[1, 1] + at[1] * own[2, 1] + at[2] * own[3, 1],
        own[0, 2] + at[0] * own[1, 2] + at[1] * own[2, 2] + at[2] * own[3, 2],
    )


@compiled("void(float64[:, ::1], float64[::1], float64[:, ::1])")
def _to_own(
    hull: NDArray[np.float64], solid: NDArray[np.float64], own: NDArray[np.float64]
) -> None:
    """Fill `own`, (4, 3), with centre and axes of a box in the axes of a solid."""
    cos, sin = solid[6], solid[7]
    for row in range(4):
        x, y = hull[row, 0], hull[row, 1]
        if row == 0:
            x, y = x - solid[0], y - solid[1]
        own[row, 0], own[row, 1], own[row, 2] = cos * x + sin * y, cos * y - sin * x, hull[row, 2]


@compiled("float64(float64[:, ::1], float64[::1], UniTuple(float64, 3), float64[:, ::1], float64)")
def _step(
    own: NDArray[np.float64],
    half_m: NDArray[np.float64],
    pull: tuple[float, float, float],
    places: NDArray[np.float64],
    weight: float,
) -> float:
    """Take a gradient step with momentum, and return the weight of the next momentum.

    Args:
        own: (4, 3) centre and axes of the box in the axes of the solid.
        half_m: (3,) half sizes of the box.
        pull: from the solid's nearest point to the second of `places`.
        places: (2, 3) the present place in the box, and the one ahead by the momentum.
        weight: weight of the momentum.
    """
    at, ahead = places[0], places[1]
    moved, uphill = np.empty(3), 0.0
    for side in range(3):
        axis = own[1 + side]
        slope = pull[0] * axis[0] + pull[1] * axis[1] + pull[2] * axis[2]
        there = min(max(ahead[side] - slope, -half_m[side]), half_m[side])
        moved[side] = there - at[side]
        uphill += (ahead[side] - there) * moved[side]
        at[side] = there
    if uphill > 0.0:  # the momentum points the wrong way
        ahead[:] = at
        return 1.0
    heavier = (1.0 + math.sqrt(1.0 + 4.0 * weight * weight)) / 2.0
    ahead[:] = at + (weight - 1.0) / heavier * moved
    return heavier


@compiled(
    "UniTuple(float64, 4)(float64[:, ::1], float64[::1], float64[::1], float64[:, :, ::1], float64)"
)
def _gap(
    hull: NDArray[np.float64],
    half_m: NDArray[np.float64],
    solid: NDArray[np.float64],
    facets: NDArray[np.float64],
    far_m: float,
) -> tuple[float, float, float, float]:
    """Return the distance from a box to a solid, and the direction from the solid to the box.

    Args:
        hull: (4, 3) centre and axes of the box in the world.
        half_m: (3,) half sizes of the box.
        solid: (GAP_COLUMNS,) row of a table of solids.
        facets: (F, 4, 3) facets of all hulls.
        far_m: a distance beyond this need not be exact.

    Returns:
        Distance, m, 0 where they overlap; unit vector, world axes, 0 where they overlap.
    """
    own, places, weight = np.empty((4, 3)), np.zeros((2, 3)), 1.0
    facets = _own_facets(solid, facets)
    _to_own(hull, solid, own)
    distance = nx = ny = nz = 0.0
    for _ in range(_STEPS):
        x, y, z = _point(own, places[1])
        qx, qy, qz = _nearest(solid, facets, x, y, z)
        weight = _step(own, half_m, (x - qx, y - qy, z - qz), places, weight)
        x, y, z = _point(own, places[0])
        qx, qy, qz = _nearest(solid, facets, x, y, z)
        x, y, z = x - qx, y - qy, z - qz
        distance = math.sqrt(x * x + y * y + z * z)
        if distance < _TOUCH_M:
            return 0.0, 0.0, 0.0, 0.0
        nx, ny, nz = x / distance, y / distance, z / distance
        # The solid lies behind the plane through its nearest point, the box before another one.
        least = nx * (own[0, 0] - qx) + ny * (own[0, 1] - qy) + nz * (own[0, 2] - qz)
        for side in range(3):
            axis = own[1 + side]
            least -= abs(nx * axis[0] + ny * axis[1] + nz * axis[2]) * half_m[side]
        if least > far_m or distance - least < _TOLERANCE_M:
            break
    cos, sin = solid[6], solid[7]
    return distance, cos * nx - sin * ny, sin * nx + cos * ny, nz


@compiled("float64(float64[::1], float64[::1], float64[::1])")
def _at_least(
    pose: NDArray[np.float64], half_m: NDArray[np.float64], solid: NDArray[np.float64]
) -> float:
    """Return a lower bound of the distance: that of the ball around the hull."""
    dx, dy = pose[0] - solid[0], pose[1] - solid[1]
    along, across = solid[6] * dx + solid[7] * dy, solid[6] * dy - solid[7] * dx
    x, y, z = _nearest_upright(solid, along, across, pose[2])
    ball_m = math.sqrt(half_m[0] ** 2 + half_m[1] ** 2 + half_m[2] ** 2)
    return math.sqrt((along - x) ** 2 + (across - y) ** 2 + (pose[2] - z) ** 2) - ball_m


@compiled("float64(float64[::1], float64[::1], Tuple((float64[:, ::1], float64[:, :, ::1])))")
def clearance(pose: NDArray[np.float64], half_m: NDArray[np.float64], solids: Table) -> float:
    """Return the distance from the hull to the nearest solid.

    Args:
        pose: (6,) world x, y and z, m; roll, pitch (nose-up) and yaw, rad.
        half_m: (3,) half sizes of the hull: forward, sideways, up.
        solids: (S, GAP_COLUMNS) table of solids, and (F, 4, 3) facets of their hulls.

    Returns:
        Distance, m; 0 where they overlap, inf without a solid.
    """
    (rows, facets), hull, nearest = solids, np.empty((4, 3)), np.inf
    _orient(pose, hull)
    for index in range(len(rows)):
        if _at_least(pose, half_m, rows[index]) < nearest:
            nearest = min(nearest, _gap(hull, half_m, rows[index], facets, nearest)[0])
    return nearest


@compiled("UniTuple(float64, 3)(float64[::1], float64[:, :, ::1], float64[::1])")
def _way_out(
    solid: NDArray[np.float64], facets: NDArray[np.float64], pose: NDArray[np.float64]
) -> tuple[float, float, float]:
    """Return the normal of the face of a solid that is nearest to a point in it, world axes."""
    cos, sin = solid[6], solid[7]
    dx, dy = pose[0] - solid[0], pose[1] - solid[1]
    x, y = cos * dx + sin * dy, cos * dy - sin * dx
    if solid[10]:
        nx, ny, nz = way_out_of_hull(_own_facets(solid, facets), (x, y, pose[2]))
        return cos * nx - sin * ny, sin * nx + cos * ny, nz
    above, below = pose[2] - solid[5], solid[4] - pose[2]
    if solid[8]:
        away = math.hypot(x, y)
        beside, nx, ny = away - solid[2], x / max(away, _TOUCH_M), y / max(away, _TOUCH_M)
    else:
        beside, nx, ny = abs(x) - solid[2], math.copysign(1.0, x), 0.0
        if abs(y) - solid[3] > beside:
            beside, nx, ny = abs(y) - solid[3], 0.0, math.copysign(1.0, y)
    if max(above, below) > beside:
        return 0.0, 0.0, 1.0 if above > below else -1.0
    return cos * nx - sin * ny, sin * nx + cos * ny, 0.0


@compiled(
    "int64(float64[::1], float64[::1], Tuple((float64[:, ::1], float64[:, :, ::1])), float64,"
    " float64[:, ::1])"
)
def find_near(
    pose: NDArray[np.float64],
    half_m: NDArray[np.float64],
    solids: Table,
    reach_m: float,
    found: NDArray[np.float64],
) -> int:
    """Find the solids within a distance of the hull.

    Args:
        pose: (6,) world x, y and z, m; roll, pitch (nose-up) and yaw, rad.
        half_m: (3,) half sizes of the hull: forward, sideways, up.
        solids: (S, GAP_COLUMNS) table of solids, and (F, 4, 3) facets of their hulls.
        reach_m: the distance.
        found: (S, 5) whose first rows are filled: row of the solid, distance, and the direction
            from the solid to the hull. Where they overlap the distance is 0, and the direction is
            that of the solid's face through which the hull's centre leaves it soonest.

    Returns:
        Number of rows.
    """
    (rows, facets), hull, count = solids, np.empty((4, 3)), 0
    for index in range(len(rows)):
        solid = rows[index]
        if _at_least(pose, half_m, solid) > reach_m:
            continue
        if count == 0:
            _orient(pose, hull)
        distance, nx, ny, nz = _gap(hull, half_m, solid, facets, reach_m)
        if distance > reach_m:
            continue
        if distance == 0.0:
            nx, ny, nz = _way_out(solid, facets, pose)
        found[count, 0], found[count, 1] = index, distance
        found[count, 2], found[count, 3], found[count, 4] = nx, ny, nz
        count += 1
    return count
