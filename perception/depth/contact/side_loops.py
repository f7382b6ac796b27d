"""Compiled loop over the side pixels of one class."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from uav_bt.compiled import compiled
from uav_bt.types.arrays import Flags, Floats, Indices


@compiled(
    "Tuple((intp[::1], float64[::1], float64[::1]))"
    "(Array(uint8, 1, 'C', readonly=True), int64, float32[:, ::1], float64, UniTuple(float64, 2),"
    " float64[:, ::1], boolean[::1], float64[:, ::1], float64)"
)
def sides(  # noqa: PLR0917 - Numba passes arguments by position
    ids: NDArray[np.uint8],
    thing: int,
    rays: NDArray[np.float32],
    height_m: float,
    azimuths_rad: tuple[float, float],
    slopes: Floats,
    fitted: Flags,
    faces: Floats,
    corner_rad: float,
) -> tuple[Indices, Floats, Floats]:
    """Return the depth of the side pixels of a class from the base below them.

    Args:
        ids: (P,) class ids of the image.
        thing: the class id.
        rays: (3, P) rays of unit depth: forward, right, down.
        height_m: height of the lens above the ground.
        azimuths_rad: azimuth of the panorama's first column, and step between columns.
        slopes: (2, A) slope of the base, and of the lowest visible pixel, by column; or NaN.
        fitted: (A,) columns whose slope comes from the fitted line.
        faces: (0 to 2, 2) factors of cosine and sine of the line.
        corner_rad: azimuth where its second face begins.

    Returns:
        (N,) pixels; (N,) their depth, m, NaN where unknown; (N,) upper bounds, m, or NaN.
    """
    first_rad, step_rad = azimuths_rad
    pixels = np.empty(len(ids), dtype=np.intp)
    depth_m, bound_m = np.empty(len(ids)), np.empty(len(ids))
    count = 0
    for pixel in range(len(ids)):
        if ids[pixel] != thing:
            continue
        azimuth_rad = math.atan2(rays[1, pixel], rays[0, pixel])
        forward, right = np.float64(rays[0, pixel]), np.float64(rays[1, pixel])
        level = math.sqrt(forward * forward + right * right)
        nearest = np.rint((azimuth_rad - first_rad) / step_rad)
        column = int(min(max(nearest, 0.0), slopes.shape[1] - 1.0))
        slope = slopes[0, column]
        if fitted[column] and len(faces):
            face = 1 if azimuth_rad >= corner_rad else 0
            exact = (faces[face, 0] * forward + faces[face, 1] * right) / level
            slope = exact if exact > 0.0 else slope
        pixels[count] = pixel
        depth_m[count] = height_m / (slope * level)
        bound_m[count] = height_m / (slopes[1, column] * level)
        count += 1
    return pixels[:count], depth_m[:count], bound_m[:count]
