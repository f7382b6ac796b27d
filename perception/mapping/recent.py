"""The map's recent layer: obstacles near the drone, also after they have left the view.

A forward-looking camera shows neither obstacles beside the drone nor the ground nearer than about
1.2 m. The base of a standing obstacle was seen earlier, from further away. Such points are kept for
a while in the dead-reckoned frame, and dropped where ground is seen again. An obstacle that reaches
down to the image's lower edge without such a point has an unknown range. Its bearing is stored
separately, and for a while points are assumed at several ranges, until ground is seen there or
right behind them. The edge of the ground is kept in the same way.
"""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from perception.mapping.contact_scan import PointTable
from perception.mapping.landmarks import first_in_cells
from perception.mapping.view import MAX_RANGE_M, View
from uav_bt.lab.classes import GROUND, NO_ROLE
from uav_bt.types import NearObstacles, wrap_angles
from uav_bt.types.arrays import Flags, Floats
from uav_bt.types.dead_reckoning import OdometryPose

_MAX_AGE_S: Final = 30.0  # of bases; dead reckoning drifts by about a decimetre in this time
_EDGE_AGE_S: Final = 60.0  # of the edge of the ground, where a decimetre matters less; chosen
_ASSUMED_AGE_S: Final = 10.0  # of assumed points; chosen
# Ranges at which an obstacle of unknown range is assumed; nearer it would touch the body. Chosen.
_ASSUMED_M: Final = np.array([0.4, 0.6, 0.8, 1.0])
_CELL_M: Final = 0.05  # one point is kept in each cell of this size; chosen
# A known point explains an obstacle of unknown range up to this difference in bearing and up to
# this distance behind the ground that the obstacle hides. Chosen.
_EXPLAIN_RAD: Final = 0.12
_EXPLAIN_M: Final = 0.3


class _Kind(enum.IntEnum):
    """Kinds of points; in each cell only the smallest kind is kept."""

    BASE = 0
    EDGE = 1
    ASSUMED = 2


@dataclass(frozen=True, kw_only=True, eq=False)
class _Points(PointTable):
    """Points in the dead-reckoned frame."""

    until_s: Floats  # (N,) time at which a point is dropped
    seen_s: Floats  # (N,) last sighting of the point or of the obstacle there
    kinds: NDArray[np.int8]  # (N,) values of `_Kind`


_NONE: Final = _Points(
    xy_m=np.empty((0, 2)), until_s=np.empty(0), seen_s=np.empty(0), kinds=np.empty(0, dtype=np.int8)
)
_NO_RAD: Final = np.empty(0)
_NO_M: Final = np.empty((0, 2))


class RecentLayer:
    """Keeps the points of the last views."""

    def __init__(self) -> None:
        # (N, 2) Nearest ground in the newest view on the bearings of obstacles of unknown range
        # that reach the drone's height, forward and right of the body's centre at capture
        self.unplaced_m = _NO_M
        self._points, self._newest_s = _NONE, -math.inf
        self.forget()

    def expire(self, now_s: float) -> None:
        """Drop points that have expired at a time."""
        self._points = self._points.take(self._points.until_s >= now_s)

    def forget(self) -> None:
        """Drop everything."""
        self._points = _NONE
        self.pass_over(self._newest_s)

    def forget_trails(self, until_s: float, trails_m: Floats) -> None:
        """Let bases on the trails of movers expire at `until_s`, those that do so earlier excepted.

        `trails_m`: (K, 3) places in the dead-reckoned frame, and the radius around each, m.
        """
        points = self._points
        if not len(trails_m) or not len(points):
            return
        apart_m = np.hypot(*np.moveaxis(points.xy_m[:, None] - trails_m[:, :2], -1, 0))
        on_trail = (apart_m <= trails_m[:, 2]).any(axis=1) & (points.kinds == _Kind.BASE)
        sooner_s = np.where(on_trail, np.minimum(points.until_s, until_s), points.until_s)
        self._points = replace(points, until_s=sooner_s)

    def pass_over(self, captured_s: float) -> None:
        """Record a frame in which nothing can be placed."""
        self._newest_s = captured_s
        self._unplaced_rad = _NO_RAD  # dead-reckoned frame
        self.unplaced_m = _NO_M

    def add(self, view: View) -> None:
        """Add a view, whose pose is dead-reckoned."""
        found, pose, now_s = view.contacts, view.pose, view.captured_s
        self.pass_over(now_s)
        self._drop_where_ground_shows(view)
        edges_m = found.edges_m[np.hypot(*found.edges_m.T) <= MAX_RANGE_M]
        # Not the bases without a neighbour: on the vertical edge of an obstacle whose base is
        # hidden they would explain the obstacle, and give it a range that is too long.
        seen_m = [pose.points_to_world(view.body_m(each)) for each in (view.bases.xy_m, edges_m)]
        kinds = np.repeat([_Kind.BASE, _Kind.EDGE], [len(view.bases), len(edges_m)])
        self._add(
            np.vstack(seen_m), now_s + np.where(kinds == _Kind.BASE, _MAX_AGE_S, _EDGE_AGE_S), kinds
        )
        hidden_m, ended_m = view.body_m(found.hidden_m), view.body_m(found.hidden_edges_m)
        unplaced = ~self._explained(view, hidden_m, _Kind.BASE, now_s + _MAX_AGE_S)
        self._explained(view, ended_m, _Kind.EDGE, now_s + _EDGE_AGE_S)
        unplaced_rad = _bearings(hidden_m[unplaced])
        self.unplaced_m = hidden_m[unplaced & found.hidden_tall]
        self._unplaced_rad = unplaced_rad + pose.yaw_rad
        rays = np.stack([np.cos(unplaced_rad), np.sin(unplaced_rad)], axis=-1)
        assumed_m = (rays[:, None, :] * _ASSUMED_M[:, None]).reshape(-1, 2)
        until_s = np.full(len(assumed_m), now_s + _ASSUMED_AGE_S)
        kinds = np.full(len(assumed_m), _Kind.ASSUMED)
        self._add(pose.points_to_world(assumed_m), until_s, kinds)

    def near(self, pose: OdometryPose) -> NearObstacles:
        """Return the points relative to the body, whose pose is not earlier than the views."""
        points = self._points.take(self._points.until_s >= pose.time_s)
        local_m, age_s = pose.points_to_body(points.xy_m), pose.time_s - points.seen_s
        is_base, is_edge = points.kinds == _Kind.BASE, points.kinds == _Kind.EDGE
        return NearObstacles(
            points_m=local_m[is_base],
            assumed_m=local_m[points.kinds == _Kind.ASSUMED],
            edges_m=local_m[is_edge],
            points_age_s=age_s[is_base],
            edges_age_s=age_s[is_edge],
            captured_s=self._newest_s,
            unplaced_rad=wrap_angles(self._unplaced_rad - pose.yaw_rad),
        )

    def _drop_where_ground_shows(self, view: View) -> None:
        """Drop points on ground in view, and assumed points before the nearest ground in view.

        An obstacle there that reached up to the drone would hide the nearest ground.
        """
        local_m = view.pose.points_to_body(self._points.xy_m) - view.body_m(np.zeros(2))
        gone, scan = view.shows_ground(local_m)[1], view.scan
        assumed = self._points.kinds == _Kind.ASSUMED
        if assumed.any() and scan.roles.size:
            first = np.arange(len(scan.roles)), (scan.roles != NO_ROLE).argmax(axis=1)
            bearings, azimuths = _bearings(scan.level_m[:, 0]), _bearings(local_m)
            nearest = np.abs(azimuths[:, None] - bearings).argmin(axis=1)
            hidden = np.hypot(*local_m.T) < np.hypot(*scan.level_m[first].T)[nearest]
            in_view = (azimuths >= bearings[0]) & (azimuths <= bearings[-1])
            gone |= assumed & hidden & in_view & (scan.roles[first][nearest] == GROUND)
        self._points = self._points.take(~gone)

    def _explained(self, view: View, hidden_m: Floats, kind: _Kind, until_s: float) -> Flags:
        """Return which obstacles of unknown range a point of a kind explains, (N,); it is kept.

        `hidden_m`, (N, 2), is the nearest ground on their bearings, from the body's centre.
        """
        if not len(hidden_m):
            return np.zeros(0, dtype=bool)
        rows = np.flatnonzero(self._points.kinds == kind)
        local_m = view.pose.points_to_body(self._points.xy_m)[rows]
        explains: Flags = (
            np.abs(_bearings(hidden_m)[:, None] - _bearings(local_m)) < _EXPLAIN_RAD
        ) & (np.hypot(*local_m.T) <= np.hypot(*hidden_m.T)[:, None] + _EXPLAIN_M)
        there = rows[explains.any(axis=0)]
        ends_s, seen_s = self._points.until_s.copy(), self._points.seen_s.copy()
        ends_s[there], seen_s[there] = until_s, self._newest_s
        self._points = replace(self._points, until_s=ends_s, seen_s=seen_s)
        return np.asarray(explains.any(axis=1))

    def _add(self, xy_m: Floats, until_s: Floats, kinds: NDArray[np.int64]) -> None:
        if not len(xy_m):
            return
        seen_s = np.full(len(xy_m), self._newest_s)
        new = _Points(xy_m=xy_m, until_s=until_s, seen_s=seen_s, kinds=kinds.astype(np.int8))
        points = new.with_rows(self._points)
        # Of one kind the newest point is kept.
        keys = -points.until_s, points.kinds
        self._points = points.take(first_in_cells(points.xy_m, _CELL_M, *keys))


def _bearings(points_m: Floats) -> Floats:
    """Return the bearings of points, (N,), radians from the heading."""
    return np.asarray(np.arctan2(points_m[:, 1], points_m[:, 0]))
