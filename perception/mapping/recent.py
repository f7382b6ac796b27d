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

import numpy as np
from numpy.typing import NDArray

from perception.mapping.tables import PointTable, first_in_cells
from perception.mapping.view import View
from uav_bt.lab.classes import GROUND, NO_ROLE
from uav_bt.types import NearObstacles, wrap_angles
from uav_bt.types.arrays import Flags, Floats
from uav_bt.types.dead_reckoning import OdometryPose


@dataclass(frozen=True, kw_only=True)
class RecentLayerConfig:
    """Which points are kept, and for how long."""

    max_age_s: float = 30.0  # of bases. Dead reckoning drifts by about a decimetre in this time.
    edge_age_s: float = 60.0  # of the edge of the ground, where a decimetre matters less. Chosen.
    assumed_age_s: float = 10.0  # of assumed points. Chosen.
    # Ranges at which an obstacle of unknown range is assumed. A nearer obstacle would touch the
    # body. Chosen.
    assumed_ranges_m: tuple[float, ...] = (0.4, 0.6, 0.8, 1.0)
    cell_m: float = 0.05  # one point is kept in each cell of this size. Chosen.
    # A known point explains an obstacle of unknown range up to this difference in bearing and up
    # to `explain_m` behind the ground that the obstacle hides. Chosen.
    explain_rad: float = 0.12
    explain_m: float = 0.3


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

    @classmethod
    def of(cls, xy_m: Floats, *, until_s: float, seen_s: float, kind: _Kind) -> _Points:
        """Return points with equal times and kind."""
        count = len(xy_m)
        return cls(
            xy_m=xy_m,
            until_s=np.full(count, until_s),
            seen_s=np.full(count, seen_s),
            kinds=np.full(count, kind, dtype=np.int8),
        )


_NONE = _Points.of(np.empty((0, 2)), until_s=0.0, seen_s=0.0, kind=_Kind.BASE)


class RecentLayer:
    """Keeps the points of the last views.

    Args:
        config: which points are kept.
    """

    def __init__(self, config: RecentLayerConfig | None = None) -> None:
        self._config = config or RecentLayerConfig()
        self._points = _NONE
        self._newest_s = -math.inf
        self._unplaced_rad = self._unplaced_edges_rad = np.empty(0)  # dead-reckoned frame
        self._unplaced_m = np.empty((0, 2))

    @property
    def unplaced_m(self) -> Floats:
        """Nearest ground in the newest view on the bearings of obstacles of unknown range, (N, 2).

        Forward and right of the body's centre at capture; of obstacles that reach the drone's
        height.
        """
        return self._unplaced_m

    def expire(self, now_s: float) -> None:
        """Drop points that have expired at a time."""
        self._points = self._points.take(self._points.until_s >= now_s)

    def forget(self) -> None:
        """Drop everything."""
        self._points = _NONE
        self._forget_unplaced()

    def _forget_unplaced(self) -> None:
        self._unplaced_rad = self._unplaced_edges_rad = np.empty(0)
        self._unplaced_m = np.empty((0, 2))

    def forget_trails(self, until_s: float, trails_m: Floats) -> None:
        """Limit the life of bases on the trails of movers.

        Args:
            until_s: time at which these bases are dropped at the latest.
            trails_m: (K, 3) places in the dead-reckoned frame, and the radius around each, m.
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
        self._forget_unplaced()

    def add(self, view: View) -> None:
        """Add a view, whose pose is dead-reckoned."""
        cfg, found, pose = self._config, view.contacts, view.pose
        self.pass_over(view.captured_s)
        self._drop_where_ground_shows(view)
        self._drop_assumed_before_ground(view)
        base_s, edge_s = view.captured_s + cfg.max_age_s, view.captured_s + cfg.edge_age_s
        edges_m = found.edges_m[np.hypot(*found.edges_m.T) <= view.config.max_range_m]
        # Not the bases without a neighbour: on the vertical edge of an obstacle whose base is
        # hidden they would explain the obstacle, and give it a range that is too long.
        for seen_m, until_s, kind in (
            (view.bases_m, base_s, _Kind.BASE),
            (edges_m, edge_s, _Kind.EDGE),
        ):
            xy_m = pose.points_to_world(view.body_m(seen_m))
            self._add(_Points.of(xy_m, until_s=until_s, seen_s=self._newest_s, kind=kind))
        hidden_m, ended_m = view.body_m(found.hidden_m), view.body_m(found.hidden_edges_m)
        unplaced = ~self._explained(view, hidden_m, _Kind.BASE, base_s)
        unplaced_rad = _bearings(hidden_m[unplaced])
        self._unplaced_m = hidden_m[unplaced & found.hidden_tall]
        self._unplaced_rad = unplaced_rad + pose.yaw_rad
        ended_m = ended_m[~self._explained(view, ended_m, _Kind.EDGE, edge_s)]
        self._unplaced_edges_rad = _bearings(ended_m) + pose.yaw_rad
        rays = np.stack([np.cos(unplaced_rad), np.sin(unplaced_rad)], axis=-1)
        assumed_m = (rays[:, None, :] * np.array(cfg.assumed_ranges_m)[:, None]).reshape(-1, 2)
        assumed_s = view.captured_s + cfg.assumed_age_s
        xy_m, seen_s = pose.points_to_world(assumed_m), self._newest_s
        self._add(_Points.of(xy_m, until_s=assumed_s, seen_s=seen_s, kind=_Kind.ASSUMED))

    def near(self, pose: OdometryPose) -> NearObstacles:
        """Return the points relative to the body.

        Args:
            pose: dead-reckoned pose of the body, not earlier than the views.
        """
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
            unplaced_edges_rad=wrap_angles(self._unplaced_edges_rad - pose.yaw_rad),
        )

    def _drop_where_ground_shows(self, view: View) -> None:
        local_m = view.pose.points_to_body(self._points.xy_m)
        _, ground = view.shows_ground(local_m - view.body_m(np.zeros(2)))
        self._points = self._points.take(~ground)

    def _drop_assumed_before_ground(self, view: View) -> None:
        """Drop assumed points before the nearest ground in view.

        An obstacle there that reached up to the drone would hide the nearest ground.
        """
        scan, assumed = view.scan, self._points.kinds == _Kind.ASSUMED
        if not assumed.any() or not scan.roles.size:
            return
        first = np.arange(len(scan.roles)), (scan.roles != NO_ROLE).argmax(axis=1)
        bearings = np.arctan2(scan.level_m[:, 0, 1], scan.level_m[:, 0, 0])
        local_m = view.pose.points_to_body(self._points.xy_m[assumed]) - view.body_m(np.zeros(2))
        azimuths = _bearings(local_m)
        nearest = np.abs(azimuths[:, None] - bearings).argmin(axis=1)
        hidden = np.hypot(*local_m.T) < np.hypot(*scan.level_m[first].T)[nearest]
        in_view = (azimuths >= bearings[0]) & (azimuths <= bearings[-1])
        ground = scan.roles[first][nearest] == GROUND
        kept = ~assumed
        kept[assumed] = ~(hidden & in_view & ground)
        self._points = self._points.take(kept)

    def _explained(self, view: View, hidden_m: Floats, kind: _Kind, until_s: float) -> Flags:
        """Return which obstacles of unknown range a known point explains, (N,).

        A point that explains an obstacle is kept until `until_s`.

        Args:
            view: the newest view.
            hidden_m: (N, 2) the nearest ground in view on bearings where an obstacle hides it,
                forward and right of the body's centre.
            kind: kind of the points that may explain them.
            until_s: new expiry time of explaining points.
        """
        cfg, points = self._config, self._points
        local_m = view.pose.points_to_body(points.xy_m)
        limits_m = np.hypot(*hidden_m.T) + cfg.explain_m
        explains: Flags = (
            (np.abs(_bearings(hidden_m)[:, None] - _bearings(local_m)) < cfg.explain_rad)
            & (np.hypot(*local_m.T) <= limits_m[:, None])
            & (points.kinds == kind)
        )
        there = explains.any(axis=0)
        self._points = replace(
            points,
            until_s=np.where(there, until_s, points.until_s),
            seen_s=np.where(there, self._newest_s, points.seen_s),
        )
        return np.asarray(explains.any(axis=1))

    def _add(self, new: _Points) -> None:
        if len(new):
            points = new.with_rows(self._points)
            # Of one kind the newest point is kept.
            cell_m, keys = self._config.cell_m, (-points.until_s, points.kinds)
            self._points = points.take(first_in_cells(points.xy_m, cell_m, *keys))


def _bearings(points_m: Floats) -> Floats:
    """Return the bearings of points, (N,), radians from the heading."""
    return np.asarray(np.arctan2(points_m[:, 1], points_m[:, 0]))
