"""The map's points: bases of obstacles, and edges of the ground.

A point keeps the position from the first views, so that later sightings correct the drone's pose
instead of moving the point with the drift. It is removed when views show ground around it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Final, Self

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import cdist

from perception.mapping.contact_scan import PointTable
from perception.mapping.view import View
from uav_bt.types.arrays import Flags, Floats, Ids, Indices

_SAME_M: Final = 0.08  # a point seen this near to a known point is that point again; chosen
# A point with this weight no longer moves. A sighting at 1 m has weight 1, and the weight falls
# with the square of the range. Chosen.
_ENOUGH: Final = 3.0
_MAX_WEIGHT: Final = 4.0  # of one sighting, at 0.5 m and nearer; chosen
# Ground at a point counts against it only if ground is also seen at 0.05 m on all four sides.
# Chosen.
_PROBES_M: Final = 0.05 * np.array([[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1]])
# A point is removed after this number of views with ground around it: its weight, within these
# limits. One view with a wrong pose must not remove the points that would correct the pose. Chosen.
_MISSED: Final = 3.0, 10.0
# A leg is seen again this near to its point: it is narrower than the errors of a view. Chosen.
_LEG_M: Final = 0.15


@dataclass(frozen=True, kw_only=True, eq=False)
class Landmarks(PointTable):
    """Points of one kind in the map's frame."""

    weight: Floats  # (N,) weight of the sightings that placed it, 1/m2
    first_s: Floats  # (N,) capture time of the first view that showed it
    seen_s: Floats  # (N,) capture time of the newest view that showed it
    settled_s: Floats  # (N,) from then on points beside it count as the same standing obstacle
    from_m: Floats  # (N, 2) position of the camera at the first sighting
    ids: Ids  # (N,) class of the obstacle; background at the edge of the ground
    missed: Floats  # (N,) number of views with only ground there since the last sighting

    @classmethod
    def of(cls, view: View, points_m: Floats, ids: Ids) -> Self:
        """Return points of a view, placed by its pose."""
        lens, times_s = view.lens, np.full(len(points_m), view.captured_s)
        return cls(
            xy_m=lens.points_to_world(points_m),
            weight=1.0 / np.maximum((points_m**2).sum(axis=1), 1.0 / _MAX_WEIGHT),
            first_s=times_s,
            seen_s=times_s,
            settled_s=times_s,
            from_m=np.tile([lens.x_m, lens.y_m], (len(points_m), 1)),
            ids=ids,
            missed=np.zeros(len(points_m)),
        )

    @classmethod
    def none(cls) -> Self:
        """Return an empty table."""
        pairs, empty, ids = np.empty((0, 2)), np.empty(0), np.empty(0, dtype=np.uint8)
        times_s = {"first_s": empty, "seen_s": empty, "settled_s": empty}
        return cls(xy_m=pairs, weight=empty, from_m=pairs, ids=ids, missed=empty, **times_s)


def merge(known: Landmarks, seen: Landmarks, *, adds: bool = True) -> Landmarks:
    """Return the known points with those of a view; new ones only if it `adds`.

    A point of the view near a known point is that point again, which moves to the weighted mean of
    its sightings.
    """
    seen = seen.take(first_in_cells(seen.xy_m, _SAME_M))
    if not len(known) or not len(seen):
        return known.with_rows(seen) if adds else known
    apart_m, nearest = nearest_circles(seen.xy_m, known.xy_m)
    again = apart_m <= _SAME_M
    result = known.with_rows(seen.take(~again & adds))  # a copy
    rows, weight = nearest[again], seen.weight[again]  # several may be of one known point
    moves = result.weight[rows] < _ENOUGH
    pull_m = weight[:, None] * (seen.xy_m[again] - result.xy_m[rows])
    np.add.at(result.weight, rows, weight)
    np.add.at(result.xy_m, rows[moves], pull_m[moves] / result.weight[rows[moves], None])
    result.seen_s[rows] = seen.seen_s[again]
    result.missed[rows] = 0.0
    return result


def find_free(known: Landmarks, view: View, on_legs: Flags) -> tuple[Flags, Flags]:
    """Return which known points lie in a view, and at which of them it shows ground, (N,).

    The view is placed in the map's frame; `on_legs` has the classes that stand on legs.
    """
    local_m = view.lens.points_to_body(known.xy_m)
    near = np.flatnonzero(np.hypot(*local_m.T) <= view.reach_m)
    inside, ground = view.shows_ground(local_m[near, None, :] + _PROBES_M)
    in_view, free = np.zeros((2, len(known)), dtype=bool)
    in_view[near] = inside.all(axis=1)
    free[near] = ground.all(axis=1)
    if on_legs.any():
        legs = np.flatnonzero(free & on_legs[known.ids])
        seen_m = view.bases.xy_m[on_legs[view.bases.ids]]
        free[legs] = nearest_circles(local_m[legs], seen_m)[0] > _LEG_M
    return in_view, free


def drop_missed(known: Landmarks, free: Flags) -> Landmarks:
    """Count a view against `free` points, and drop those missed too often."""
    if not free.any():
        return known
    missed = known.missed + free
    return replace(known, missed=missed).take(missed < np.clip(known.weight, *_MISSED))


def first_in_cells(xy_m: Floats, cell_m: float, *keys: NDArray[Any]) -> Indices:
    """Return the row of the first point in each cell of a grid, ordered by cell.

    The points of a cell are sorted by `keys`, (N,) columns, the least important first.
    """
    cells = np.floor(xy_m / cell_m).astype(np.int64)
    codes = (cells[:, 0] << 32) + cells[:, 1]
    order = np.lexsort((*keys, codes))
    codes = codes[order]
    begins = np.ones(len(codes), dtype=bool)
    np.not_equal(codes[1:], codes[:-1], out=begins[1:])
    return np.asarray(order[begins])


def clusters(xy_m: Floats, apart_m: float) -> Indices:
    """Return the number of each point's cluster by single linkage, in the order of first points."""
    beside = cdist(xy_m, xy_m) <= apart_m
    firsts, before = np.arange(len(xy_m)), None
    while before is None or (firsts != before).any():
        before = firsts
        firsts = np.where(beside, firsts, len(xy_m)).min(axis=1, initial=len(xy_m))
        firsts = firsts[firsts]
    return np.unique(firsts, return_inverse=True)[1]


def nearest_circles(
    xy_m: Floats, centres_m: Floats, radii_m: Floats | float = 0.0
) -> tuple[Floats, Indices]:
    """Return each point's distance to its nearest circle, negative inside, and that circle's row.

    Without circles the distance is infinite.
    """
    if not len(centres_m):
        return np.full(len(xy_m), np.inf), np.zeros(len(xy_m), dtype=np.intp)
    off_m = cdist(xy_m, centres_m) - radii_m
    nearest = off_m.argmin(axis=1)
    return off_m[np.arange(len(xy_m)), nearest], nearest
