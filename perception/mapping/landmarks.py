"""The map's points: bases of obstacles, and edges of the ground.

A point keeps the position from the first views, so that later sightings correct the drone's pose
instead of moving the point with the drift. It is removed when views show ground around it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from perception.mapping.tables import PointTable, first_in_cells, nearest_circles
from perception.mapping.view import View
from uav_bt.lab.classes import OUTSIDE
from uav_bt.types.arrays import Flags, Floats


@dataclass(frozen=True, kw_only=True)
class LandmarkConfig:
    """Which points are kept, and when they are removed."""

    same_m: float = 0.08  # a point seen this near to a known point is that point again. Chosen.
    # A point with this weight no longer moves. A sighting at 1 m has weight 1, and the weight falls
    # with the square of the range. Chosen.
    enough: float = 3.0
    max_weight: float = 4.0  # of one sighting, at 0.5 m and nearer. Chosen.
    # Ground at a point counts against it only if ground is also seen at this distance on all four
    # sides. Chosen.
    probe_m: float = 0.05
    # A point is removed after a number of views with ground around it. This number is its weight,
    # at least `min_missed` and at most `max_missed`. One view with a wrong pose must not remove the
    # points that would correct the pose. Chosen.
    min_missed: float = 3.0
    max_missed: float = 10.0
    # A leg is seen again this near to its point: it is narrower than the errors of a view. Chosen.
    leg_m: float = 0.15


@dataclass(frozen=True, kw_only=True, eq=False)
class Landmarks(PointTable):
    """Points of one kind.

    Attributes:
        xy_m: (N, 2) positions in the map's frame.
        weight: (N,) weight of the sightings that placed it, 1/m2.
        first_s: (N,) capture time of the first view that showed it.
        seen_s: (N,) capture time of the newest view that showed it.
        settled_s: (N,) time from which points beside it count as the same standing obstacle.
        from_m: (N, 2) position of the camera at the first sighting.
        ids: (N,) uint8 class of the obstacle; background at the edge of the ground.
        missed: (N,) number of views with only ground there since the last sighting.
    """

    weight: Floats
    first_s: Floats
    seen_s: Floats
    settled_s: Floats
    from_m: Floats
    ids: NDArray[np.uint8]
    missed: Floats

    @classmethod
    def none(cls) -> Landmarks:
        """Return an empty table."""
        return cls(
            xy_m=np.empty((0, 2)),
            weight=np.empty(0),
            first_s=np.empty(0),
            seen_s=np.empty(0),
            settled_s=np.empty(0),
            from_m=np.empty((0, 2)),
            ids=np.empty(0, dtype=np.uint8),
            missed=np.empty(0),
        )

    def settled_after(self, waits_s: Floats) -> Landmarks:
        """Return the points with later settling times.

        Args:
            waits_s: (N,) delays.
        """
        return replace(self, settled_s=self.settled_s + waits_s)


def bases_of(view: View, config: LandmarkConfig) -> Landmarks:
    """Return the bases of a view, placed by its pose."""
    return _placed(view, view.bases_m, view.base_ids, config)


def edges_of(view: View, config: LandmarkConfig) -> Landmarks:
    """Return the edges of the ground in a view, placed by its pose."""
    ids = np.full(len(view.edges_m), OUTSIDE, dtype=np.uint8)
    return _placed(view, view.edges_m, ids, config)


def _placed(
    view: View, points_m: Floats, ids: NDArray[np.uint8], config: LandmarkConfig
) -> Landmarks:
    lens, count = view.lens, len(points_m)
    times_s = np.full(count, view.captured_s)
    return Landmarks(
        xy_m=lens.points_to_world(points_m),
        weight=1.0 / np.maximum((points_m**2).sum(axis=1), 1.0 / config.max_weight),
        first_s=times_s,
        seen_s=times_s,
        settled_s=times_s,
        from_m=np.tile([lens.x_m, lens.y_m], (count, 1)),
        ids=ids,
        missed=np.zeros(count),
    )


def merge(
    known: Landmarks, seen: Landmarks, config: LandmarkConfig, *, adds: bool = True
) -> Landmarks:
    """Return the known points with those of a view.

    A point of the view near a known point is that point again, which moves to the weighted mean of
    its sightings. The others are new.

    Args:
        known: the map's points.
        seen: the view's points.
        config: distances and weights.
        adds: whether new points are added.
    """
    seen = seen.take(first_in_cells(seen.xy_m, config.same_m))
    if not len(known) or not len(seen):
        return known.with_rows(seen) if adds else known
    apart_m, nearest = nearest_circles(seen.xy_m, known.xy_m, np.zeros(len(known)))
    again = apart_m <= config.same_m
    result = known.with_rows(seen.take(~again & adds))  # a copy
    rows, sighted = nearest[again], seen.take(again)  # several may be of one known point
    moves = result.weight[rows] < config.enough
    pull_m = sighted.weight[:, None] * (sighted.xy_m - result.xy_m[rows])
    np.add.at(result.weight, rows, sighted.weight)
    np.add.at(result.xy_m, rows[moves], pull_m[moves] / result.weight[rows[moves], None])
    result.seen_s[rows] = sighted.seen_s
    result.missed[rows] = 0.0
    return result


def find_free(
    known: Landmarks, view: View, config: LandmarkConfig, on_legs: Flags | None = None
) -> tuple[Flags, Flags]:
    """Return which known points lie in a view, and which of them show ground.

    Args:
        known: the map's points, N of them.
        view: placed in the map's frame.
        config: distance around a point at which ground must be seen.
        on_legs: (number of classes,) whether a class stands on legs; default: none.

    Returns:
        (N,) whether a point and its surroundings lie in the image and in range; and (N,) whether
        they also show only ground.
    """
    local_m = view.lens.points_to_body(known.xy_m)
    probe_m = config.probe_m * np.array([[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1]])
    inside, ground = view.shows_ground(local_m[:, None, :] + probe_m)
    in_view = inside.all(axis=1) & (np.hypot(*local_m.T) <= view.reach_m)
    free = in_view & ground.all(axis=1)
    if on_legs is not None and on_legs.any():
        legs = np.flatnonzero(free & on_legs[known.ids])
        seen_m = view.bases_m[on_legs[view.base_ids]]
        off_m, _ = nearest_circles(local_m[legs], seen_m, np.zeros(len(seen_m)))
        free[legs] = off_m > config.leg_m
    return np.asarray(in_view), np.asarray(free)


def drop_missed(known: Landmarks, free: Flags, config: LandmarkConfig) -> Landmarks:
    """Count a view against points with only ground around them, and drop those missed too often.

    Args:
        known: the map's points, N of them.
        free: (N,) points around which the view shows only ground.
        config: limits for dropping points.
    """
    if not free.any():
        return known
    missed = known.missed + free
    enough = np.clip(known.weight, config.min_missed, config.max_missed)
    return replace(known, missed=missed).take(missed < enough)
