"""Compiled loops over the samples of a class map.

They are imported late, because commands that fly nothing must not wait for Numba.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from uav_bt.compiled import compiled
from uav_bt.lab.classes import GROUND, NO_ROLE
from uav_bt.types.arrays import Flags, Floats


@compiled(
    "Tuple((float64[:, :, ::1], uint8[:, ::1], uint8[:, ::1]))"
    "(Array(uint8, 2, 'C', readonly=True), uint8[:, ::1], float64[:, ::1], float64[::1], float64,"
    " float64[:, ::1], UniTuple(float64, 4))"
)
def sampled(  # noqa: PLR0917 - Numba passes arguments by position
    image_ids: NDArray[np.uint8],
    image_roles: NDArray[np.uint8],
    directions: NDArray[np.float64],
    ranges_m: NDArray[np.float64],
    height_m: float,
    axes: NDArray[np.float64],
    pinhole_px: tuple[float, float, float, float],
) -> tuple[NDArray[np.float64], NDArray[np.uint8], NDArray[np.uint8]]:
    """Sample a class map on a polar grid of the ground.

    Args:
        image_ids: (H, W) class ids.
        image_roles: (H, W) role ids.
        directions: (B, 2) cosine and sine of each bearing.
        ranges_m: (E,) horizontal range of the samples on a bearing.
        height_m: height of the camera.
        axes: (3, 3) rotation from the camera frame to the level frame.
        pinhole_px: focal lengths and principal point: fx, fy, cx, cy.

    Returns:
        (B, E, 2) samples, metres forward and right; (B, E) their class ids and (B, E) role ids,
        `NO_ROLE` outside the image.
    """
    fx, fy, cx, cy = pinhole_px
    shape = len(directions), len(ranges_m)
    level_m = np.empty((shape[0], shape[1], 2))
    ids = np.full(shape, NO_ROLE, dtype=np.uint8)
    roles = np.full(shape, NO_ROLE, dtype=np.uint8)
    for bearing in range(shape[0]):
        for sample in range(shape[1]):
            forward_m = directions[bearing, 0] * ranges_m[sample]
            right_m = directions[bearing, 1] * ranges_m[sample]
            level_m[bearing, sample, 0] = forward_m
            level_m[bearing, sample, 1] = right_m
            depth = forward_m * axes[0, 2] + right_m * axes[1, 2] + height_m * axes[2, 2]
            if not depth > 1e-9:  # behind the camera, as `project` has it
                continue
            x = forward_m * axes[0, 0] + right_m * axes[1, 0] + height_m * axes[2, 0]
            y = forward_m * axes[0, 1] + right_m * axes[1, 1] + height_m * axes[2, 1]
            column, row = np.rint(fx * x / depth + cx), np.rint(fy * y / depth + cy)
            inside = 0 <= column < image_ids.shape[1] and 0 <= row < image_ids.shape[0]
            if inside:
                ids[bearing, sample] = image_ids[int(row), int(column)]
                roles[bearing, sample] = image_roles[int(row), int(column)]
    return level_m, ids, roles


@compiled(
    "Tuple((intp[::1], intp[::1], uint8[::1]))(Array(uint8, 2, 'C', readonly=True), int64, int64)"
)
def first_runs(
    sampled: NDArray[np.uint8], role: int, min_run: int
) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.uint8]]:
    """Find the nearest run of a role on each bearing; samples go from near to far.

    Args:
        sampled: (B, E) role ids.
        role: the role id.
        min_run: samples of a run at least.

    Returns:
        The bearings with a run, the index of its first sample, and the role before it.
    """
    rows = np.empty(len(sampled), dtype=np.intp)
    first = np.empty(len(sampled), dtype=np.intp)
    before = np.empty(len(sampled), dtype=np.uint8)
    found = 0
    for bearing in range(sampled.shape[0]):
        run = 0
        for sample in range(sampled.shape[1]):
            run = run + 1 if sampled[bearing, sample] == role else 0
            if run == min_run:
                begin = sample - run + 1
                rows[found], first[found] = bearing, begin
                before[found] = sampled[bearing, begin - 1] if begin > 0 else NO_ROLE
                found += 1
                break
    return rows[:found], first[:found], before[:found]


@compiled(
    "float64[::1](float64[:, :, ::1], uint8[:, ::1], intp[::1], intp[::1],"
    " Array(uint8, 1, 'C', readonly=True), float64)"
)
def upper_edges(  # noqa: PLR0917 - Numba passes arguments by position
    level_m: NDArray[np.float64],
    ids: NDArray[np.uint8],
    rows: NDArray[np.intp],
    first: NDArray[np.intp],
    roof_of: NDArray[np.uint8],
    height_m: float,
) -> NDArray[np.float64]:
    """Return the heights of the upper edges of sides.

    A side is vertical, so its upper edge has the range of its base. The edge is known where the
    roof above it is in view.

    Args:
        level_m: (B, E, 2) samples of a scan, metres forward and right.
        ids: (B, E) their class ids.
        rows: (N,) bearings of the sides.
        first: (N,) index of the first sample of each side, not 0.
        roof_of: (C,) class of the roof on the sides of each class; 0 without one.
        height_m: height of the camera above the ground.

    Returns:
        (N,) metres above the ground; NaN where the side does not end at two samples of its roof.
    """
    heights_m = np.full(len(rows), np.nan)
    for side in range(len(rows)):
        row, base, end = rows[side], first[side], first[side]
        class_id = ids[row, base]
        while end < ids.shape[1] and ids[row, end] == class_id:
            end += 1
        roof = roof_of[class_id]
        if roof == 0 or end + 1 >= ids.shape[1]:
            continue
        if ids[row, end] == roof and ids[row, end + 1] == roof:
            ranges_m = np.hypot(level_m[row, :, 0], level_m[row, :, 1])
            base_m = (ranges_m[base - 1] + ranges_m[base]) / 2.0
            slope = (height_m / ranges_m[end - 1] + height_m / ranges_m[end]) / 2.0
            heights_m[side] = height_m - base_m * slope
    return heights_m


@compiled(
    "Tuple((boolean[::1], boolean[::1]))"
    "(float64[:, ::1], float64, uint8[:, ::1], float64[:, ::1], UniTuple(float64, 4))"
)
def looked_up(
    points_m: Floats,
    height_m: float,
    image_roles: NDArray[np.uint8],
    axes: Floats,
    pinhole_px: tuple[float, float, float, float],
) -> tuple[Flags, Flags]:
    """Look up points of the ground in an image of role ids.

    Args:
        points_m: (N, 2) forward and right of the point below the camera.
        height_m: height of the camera.
        image_roles: (H, W) role ids.
        axes: (3, 3) rotation from the camera frame to the level frame.
        pinhole_px: focal lengths and principal point: fx, fy, cx, cy.

    Returns:
        (N,) whether a point lies in the image, and (N,) whether the image shows ground there.
    """
    fx, fy, cx, cy = pinhole_px
    last_row, last_column = image_roles.shape[0] - 1, image_roles.shape[1] - 1
    inside = np.zeros(len(points_m), dtype=np.bool_)
    shows = np.zeros(len(points_m), dtype=np.bool_)
    for place in range(len(points_m)):
        forward_m, right_m = points_m[place, 0], points_m[place, 1]
        depth = forward_m * axes[0, 2] + right_m * axes[1, 2] + height_m * axes[2, 2]
        if not depth > 1e-9:  # behind the camera, as `project` has it
            continue
        x = forward_m * axes[0, 0] + right_m * axes[1, 0] + height_m * axes[2, 0]
        y = forward_m * axes[0, 1] + right_m * axes[1, 1] + height_m * axes[2, 1]
        column, row = fx * x / depth + cx, fy * y / depth + cy
        if 0 <= column <= last_column and 0 <= row <= last_row:
            inside[place] = True
            role = image_roles[int(np.rint(row)), int(np.rint(column))]
            shows[place] = role == GROUND
    return inside, shows
