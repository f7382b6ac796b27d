"""Objects on legs in a scan: the ground below their boards belongs to them.

On a bearing between two legs of a table the lowest pixel of the class is the lower edge of its
board, which covers ground far behind the table. The lines between the points of one object at which
the class is seen, as far apart as its legs at most, bound the object: its nearest legs are among
these points, and the board's edge is never nearer than a line between them.

- *Between two points* the object begins at the nearest such line.
- *Beside the outer legs* the board overhangs. Such a bearing shows neither a base nor, from the
  board's edge on, ground. It is recognised by a range too long for the object's nearest point.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from uav_bt.compiled import compiled
from uav_bt.lab.classes import NO_ROLE, OBSTACLE, LabClasses
from uav_bt.types.arrays import Flags, Floats, Ids, Indices

_OVERHANG_M: Final = 0.25  # a board may extend beyond its outer legs by this; chosen
# Of the span: an outer point this far behind a leg is the edge of a board. Chosen.
_DEEPER: Final = 0.5


@dataclass(frozen=True, eq=False)
class Covered:
    """Ground below boards, which a view shows and on which an object stands."""

    bearings_rad: Floats  # (B,) bearings of the scan, increasing
    # (B, 2) between which the ground of a bearing lies below a board; NaN without one
    ranges_m: Floats

    def holds(self, points_m: Floats) -> Flags:
        """Return which points, (..., 2) from the point below the camera, lie on such ground."""
        places_rad = np.arctan2(points_m[..., 1], points_m[..., 0])
        after = np.clip(
            np.searchsorted(self.bearings_rad, places_rad), 1, len(self.bearings_rad) - 1
        )
        middles_rad = (self.bearings_rad[after - 1] + self.bearings_rad[after]) / 2
        bounds_m = self.ranges_m[after - (places_rad < middles_rad)]
        ranges_m = np.hypot(points_m[..., 0], points_m[..., 1])
        return np.asarray((ranges_m >= bounds_m[..., 0]) & (ranges_m <= bounds_m[..., 1]))


def cover_below(
    level_m: Floats, ids: Ids, roles: Ids, classes: LabClasses, runs: tuple[Indices, Indices, Ids]
) -> Covered | None:
    """Give the samples below boards to the objects on legs; return the ground there, or None.

    `level_m`, (B, E, 2), are the samples of a scan from near to far, metres forward and right.
    Their `ids` and `roles`, (B, E), are changed. `runs` are the `first_runs` of obstacles.
    """
    rows, first, before = runs
    kinds = np.zeros(len(ids), dtype=np.uint8)
    kinds[rows] = _carriers(classes)[ids[rows, first]]
    if not kinds.any():
        return None
    begins = np.zeros(len(ids), dtype=np.intp)
    begins[rows] = first
    hidden = np.zeros(len(ids), dtype=np.bool_)
    hidden[rows] = before == NO_ROLE
    every, last = np.arange(len(ids)), np.maximum(begins - 1, 0)
    last[hidden] = begins[hidden]
    points_m = (level_m[every, last] + level_m[every, begins]) / 2.0
    groups = np.cumsum(np.diff(kinds, prepend=kinds[0]) != 0)
    spans_m = classes.legs_m[kinds]
    near_m, below = _near_side(points_m, groups, hidden, spans_m)
    hangs = _overhangs(points_m, groups, near_m, spans_m) & ~hidden

    seen_m = np.hypot(*points_m.T)
    under = (spans_m > 0.0) & ~hangs & (near_m < seen_m)
    ranges_m = np.column_stack([np.where(below, 0.0, near_m), seen_m])
    ranges_m[~under] = np.nan
    nearer = np.arange(ids.shape[1]) < begins[:, None]
    roles[hangs[:, None] & ~nearer] = NO_ROLE
    held = nearer & (np.hypot(level_m[..., 0], level_m[..., 1]) >= ranges_m[:, :1])
    held &= roles != NO_ROLE
    roles[held] = OBSTACLE
    ids[held] = np.broadcast_to(kinds[:, None], ids.shape)[held]
    return Covered(bearings_rad=np.arctan2(level_m[:, 0, 1], level_m[:, 0, 0]), ranges_m=ranges_m)


def _carriers(classes: LabClasses) -> Ids:
    """Return the class on legs of each class and of the upper faces on it, (256,); 0 for others."""
    carriers = np.zeros(256, dtype=np.uint8)
    on_legs = np.flatnonzero(classes.legs_m > 0.0)
    for class_id in on_legs:
        top = int(classes.top_of[class_id])
        if top and np.count_nonzero(classes.top_of == top) == 1:
            carriers[top] = class_id
    carriers[on_legs] = on_legs
    return carriers


@compiled(
    "Tuple((float64[::1], boolean[::1]))(float64[:, ::1], intp[::1], boolean[::1], float64[::1])"
)
def _near_side(
    points_m: Floats, groups: Indices, hidden: Flags, spans_m: Floats
) -> tuple[Floats, Flags]:
    """Return the range of an object's near side by bearing, and whether it is below the image.

    For B bearings: `points_m`, the lowest points of its class; `groups`, the number of the object;
    `hidden`, whether the point is the nearest in view, and the object begins before it;
    `spans_m`, the largest distance between two of its legs, 0 without legs.
    """
    count = len(points_m)
    near_m = np.sqrt(points_m[:, 0] ** 2 + points_m[:, 1] ** 2)
    rays, below = points_m / near_m.reshape(-1, 1), np.zeros(count, dtype=np.bool_)
    for one in range(count):
        for other in range(one + 2, count):
            if groups[other] != groups[one] or spans_m[one] == 0.0:
                break
            x_m, y_m = points_m[other] - points_m[one]
            if np.hypot(x_m, y_m) > spans_m[one]:
                continue
            area = points_m[one, 0] * y_m - points_m[one, 1] * x_m
            for row in range(one + 1, other):
                across_m = rays[row, 0] * y_m - rays[row, 1] * x_m
                if across_m * near_m[row] > area:
                    near_m[row], below[row] = area / across_m, hidden[one] or hidden[other]
    return near_m, below


@compiled("boolean[::1](float64[:, ::1], intp[::1], float64[::1], float64[::1])")
def _overhangs(points_m: Floats, groups: Indices, near_m: Floats, spans_m: Floats) -> Flags:
    """Return the bearings, (B,), that show the edge of a board beside the outer legs.

    The arguments are those of `_near_side`, and the range that it returns.
    """
    count = len(points_m)
    hangs = np.zeros(count, dtype=np.bool_)
    rays = points_m / np.sqrt(points_m[:, 0] ** 2 + points_m[:, 1] ** 2).reshape(-1, 1)
    for row in range(count):
        for leg in range(count):
            if groups[leg] != groups[row] or near_m[leg] >= near_m[row]:
                continue
            along = rays[leg, 0] * rays[row, 0] + rays[leg, 1] * rays[row, 1]
            across = rays[leg, 1] * rays[row, 0] - rays[leg, 0] * rays[row, 1]
            deep_m, aside_m = near_m[row] - along * near_m[leg], abs(across) * near_m[leg]
            too_far = aside_m <= spans_m[row] and np.hypot(deep_m, aside_m) > spans_m[row]
            hangs[row] |= too_far or (aside_m <= _OVERHANG_M and deep_m > _DEEPER * spans_m[row])
        hangs[row] &= spans_m[row] > 0.0
    return hangs
