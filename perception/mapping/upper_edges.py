"""Upper edges of the map's objects in a view, and the heights above the ground that they give.

The map knows where an object stands. A vertical line on its near side is followed upwards through
the class map to where the object's class ends; the base need not be in view. Below the camera, an
object whose upper face has its own class ends somewhere above its base: the middle counts, in views
in which near and far side give about the same height. Bearings that pass another object of the
class are left out, and those with an object on legs in front: below its board one sees the lower
parts of others.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from perception.mapping.view import View
from uav_bt.compiled import compiled
from uav_bt.lab.classes import NO_ROLE
from uav_bt.types.arrays import Flags, Floats, Ids
from uav_bt.types.projection import camera_axes
from uav_bt.types.site_map import MapObject

_BEARINGS: Final = 9  # of an object in a view
_MIN_BEARINGS: Final = 3  # with an upper edge, for a height; chosen
_INSET: Final = 0.15  # share of an object's width, left out at either end for errors; chosen
_BESIDE_M: Final = 0.1  # a line of sight keeps this from other objects; chosen
_UNSURE_M: Final = 0.15  # largest difference between heights by near and by far side; chosen
_STEEPEST: Final = 10.0  # rise over range up to which a line is followed
# Above the upper edge of an object on legs nothing of it is seen for this height. Between the
# boards of a rack one sees through it. Chosen.
_CLEAR_M: Final = 0.7
_MIN_PX: Final = 2.0  # length of the object below its upper edge, and of what is above it; chosen


def upper_edges(view: View, objects: Sequence[MapObject]) -> Floats:
    """Return the heights of objects above the ground, (N,) metres; NaN where none is seen.

    The view is placed in the map's frame.
    """
    if not objects:
        return np.empty(0)
    classes, lens = view.class_map.classes, view.lens
    corners_m = lens.points_to_body(np.concatenate([one.corners_m() for one in objects]))
    ids = np.array([one.class_id for one in objects], dtype=np.uint8)
    faces = np.where(classes.top_of[ids] == 0, np.uint8(NO_ROLE), classes.top_of[ids])
    return _heights(
        np.ascontiguousarray(view.class_map.ids),
        np.ascontiguousarray(corners_m.reshape(-1, 4, 2)),
        np.column_stack([ids, faces]),
        classes.legs_m[ids] > 0.0,
        view.height_m,
        camera_axes(view.pitch_rad),
        view.camera.pinhole_px,
    )


@compiled("UniTuple(float64, 2)(float64[:, ::1], float64, float64, float64)")
def _crossing(corners_m: Floats, x: float, y: float, beside_m: float) -> tuple[float, float]:
    """Return the ranges at which a ray of unit length enters and leaves a rectangle, m.

    The rectangle is wider by a distance on all sides. Infinity and 0 where the ray misses it.
    """
    near_m, far_m = 0.0, np.inf
    middle_x, middle_y = corners_m[:, 0].mean(), corners_m[:, 1].mean()
    for side in range(2):
        along_x = corners_m[side + 1, 0] - corners_m[side, 0]
        along_y = corners_m[side + 1, 1] - corners_m[side, 1]
        length_m = max(np.hypot(along_x, along_y), 1e-6)
        along_x, along_y = along_x / length_m, along_y / length_m
        half_m = length_m / 2 + beside_m
        middle_m = middle_x * along_x + middle_y * along_y
        speed = (x * along_x + y * along_y) or 1e-9
        near_m = max(near_m, min((middle_m - half_m) / speed, (middle_m + half_m) / speed))
        far_m = min(far_m, max((middle_m - half_m) / speed, (middle_m + half_m) / speed))
    return (near_m, far_m) if near_m < far_m else (np.inf, 0.0)


@compiled(
    "float64(uint8[:, ::1], UniTuple(uint8, 2), boolean, UniTuple(float64, 3), float64,"
    " float64[:, ::1], UniTuple(float64, 4))"
)
def _edge(  # noqa: PLR0917 - Numba passes arguments by position
    image: Ids,
    classes: tuple[int, int],
    on_legs: bool,  # noqa: FBT001
    ray: tuple[float, float, float],
    start: float,
    axes: Floats,
    pinhole_px: tuple[float, float, float, float],
) -> float:
    """Return the rise over range at which an object ends on a vertical line; NaN if unknown.

    `classes` are those of its sides and its upper face. `ray` is the unit vector and the range of
    the line; `start` is where it begins.
    """
    fx, fy, cx, cy = pinhole_px
    x, y, range_m = ray
    step, least = 0.5 / fy, int(2 * _MIN_PX)
    rise, edge = start, np.nan
    # Samples of the object, off it, of its upper face in a row; and above the edge.
    own, off, face, clear = 0, 2 * least, 0, 0
    while rise < _STEEPEST:
        depth = x * axes[0, 2] + y * axes[1, 2] - rise * axes[2, 2]
        across = x * axes[0, 0] + y * axes[1, 0] - rise * axes[2, 0]
        down = x * axes[0, 1] + y * axes[1, 1] - rise * axes[2, 1]
        rise += step
        if depth <= 1e-9:
            continue
        column, row = np.rint(fx * across / depth + cx), np.rint(fy * down / depth + cy)
        if row < 0:
            break
        if row >= image.shape[0] or column < 0 or column >= image.shape[1]:
            continue
        seen = image[int(row), int(column)]
        own, off = (own + 1, 0) if seen == classes[0] else (0, off + 1)
        face = face + 1 if off > 0 and seen == classes[1] else 0
        clear += 1
        if own >= least:
            edge, clear = rise - step / 2, 0
        elif face == least and off <= least + 1:
            return rise - step * (least + 0.5)
        elif clear >= least and not on_legs and not np.isnan(edge):
            return edge
    return edge if on_legs and clear * step * range_m >= _CLEAR_M else np.nan


@compiled(
    "float64[::1](uint8[:, ::1], float64[:, :, ::1], uint8[:, ::1], boolean[::1], float64,"
    " float64[:, ::1], UniTuple(float64, 4))"
)
def _heights(  # noqa: PLR0917 - Numba passes arguments by position
    image: Ids,
    corners_m: Floats,
    classes: Ids,
    on_legs: Flags,
    height_m: float,
    axes: Floats,
    pinhole_px: tuple[float, float, float, float],
) -> Floats:
    """Return the heights of objects, (N,); `classes`, (N, 2), are of sides and upper faces."""
    found_m, heights_m = np.full(len(corners_m), np.nan), np.empty(_BEARINGS)
    for one in range(len(corners_m)):
        if corners_m[one, :, 0].min() <= 0.0:
            continue  # beside or behind the camera
        bearings = np.arctan2(corners_m[one, :, 1], corners_m[one, :, 0])
        first, width = bearings.min(), bearings.max() - bearings.min()
        heights_m[:] = np.nan
        for number in range(_BEARINGS):
            bearing = first + width * (_INSET + (1 - 2 * _INSET) * number / (_BEARINGS - 1))
            x, y = np.cos(bearing), np.sin(bearing)
            near_m, far_m = _crossing(corners_m[one], x, y, 0.0)
            for other in range(len(corners_m)):
                same = classes[other, 0] == classes[one, 0]
                if other != one and (same or on_legs[other]):
                    from_m, to_m = _crossing(corners_m[other], x, y, _BESIDE_M)
                    far_m *= to_m == 0.0 or not (same or from_m < near_m)
            if far_m <= near_m:
                continue
            kind, start = (classes[one, 0], classes[one, 1]), -height_m / near_m
            edge = _edge(image, kind, on_legs[one], (x, y, near_m), start, axes, pinhole_px)
            if kind[1] != NO_ROLE or edge > 0.0:
                far_m = near_m
            if edge * (near_m - far_m) <= _UNSURE_M:  # not for NaN
                heights_m[number] = height_m + edge * (near_m + far_m) / 2
        if np.isfinite(heights_m).sum() >= _MIN_BEARINGS:
            found_m[one] = np.nanmedian(heights_m)
    return found_m
