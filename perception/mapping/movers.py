"""Tracker of moving obstacles, which separates them from standing ones.

Bases that appear on ground that was seen free before, away from settled points, have arrived. They
are clustered in each view, and a constant-velocity Kalman filter tracks each cluster in the map's
frame. A cluster is a mover after it has moved further than the noise of depth and odometry. It
stands after it has stayed at one place for some seconds.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from perception.mapping.landmarks import clusters
from perception.mapping.mover_track import MoverConfig, MoverTrack
from uav_bt.types.arrays import Flags, Floats
from uav_bt.types.site_map import MapMover

_FAR = 1e6  # cost of a pair that must not be assigned


@dataclass(frozen=True)
class _Cluster:
    place_m: Floats  # (2,) its middle
    noise: Floats  # (2, 2) covariance of the middle, m2
    radius_m: float
    rows: NDArray[np.intp]  # indices of its points
    whole: bool  # not cut off by the end of the view


class MoverTracker:
    """Tracks clusters that have arrived on free ground.

    Args:
        config: when a cluster is a mover.
    """

    def __init__(self, config: MoverConfig | None = None) -> None:
        self._config = config or MoverConfig()
        self._tracks: list[MoverTrack] = []
        self._count = 0
        self._moved_s = -math.inf  # time of the last seen movement

    @property
    def moved_s(self) -> float:
        """Time of the last seen movement, s; -inf before the first one."""
        return self._moved_s

    def restart(self) -> None:
        """Forget all tracks, whose places are of an abandoned map.

        Numbers go on, and the last movement stays known.
        """
        self._tracks = []

    def predict(self, time_s: float) -> None:
        """Predict all tracks up to a time."""
        for track in self._tracks:
            track.predict(time_s)

    def owns(self, points_m: Floats) -> Flags:
        """Return which points lie on a mover, (N,), at the time of the last prediction.

        A mover out of view owns no points: it may have turned.

        Args:
            points_m: (N, 2) in the map's frame.
        """
        owned = np.zeros(len(points_m), dtype=bool)
        for track in self._tracks:
            if track.is_under_way and track.time_s - track.seen_s <= self._config.carry_s:
                owned |= track.holds(points_m, self._config.owned_m)
        return owned

    def follow(
        self,
        points_m: Floats,
        from_m: Floats,
        time_s: float,
        *,
        cut: Flags | None = None,
        judges: bool = True,
    ) -> Flags:
        """Track the points of a view that have arrived on free ground.

        Args:
            points_m: (N, 2) in the map's frame; N may be 0.
            from_m: (2,) position of the camera in the map's frame.
            time_s: capture time of the view.
            cut: (N,) points at the end of the view, beyond which the obstacle may continue.
            judges: whether the view may show movement.

        Returns:
            (N,) points of clusters that have stayed long enough to stand.
        """
        cfg = self._config
        self._tracks = [
            track
            for track in self._tracks
            if time_s - track.seen_s <= (cfg.life_s if track.has_moved else cfg.doubt_s)
        ]
        self.predict(time_s)
        stands = np.zeros(len(points_m), dtype=bool)
        cut = np.zeros(len(points_m), dtype=bool) if cut is None else cut
        for cluster, owner in self._assigned(self._clusters(points_m, from_m, cut)):
            if owner is not None:
                owner.sight(cluster.place_m, cluster.noise, cluster.radius_m, whole=cluster.whole)
                owner.judge(from_m, moves=judges)
                stands[cluster.rows] = owner.stands
                if owner.moves:
                    self._moved_s = time_s
            elif not any(
                math.dist(cluster.place_m, other.place_m) < cfg.same_m for other in self._tracks
            ):
                self._count += 1
                track = MoverTrack(self._count, cluster.place_m, cluster.noise, time_s, cfg)
                track.is_whole = cluster.whole
                self._tracks.append(track)
        for track in self._tracks if judges else ():
            track.leave(from_m, time_s)
        self._drop_found_again(time_s)
        return stands

    def meet(self, place_m: Floats, velocity_mps: Floats, time_s: float) -> None:
        """Add a mover that was not seen to move.

        Args:
            place_m: (2,) its assumed middle, in the map's frame.
            velocity_mps: (2,) its assumed velocity.
            time_s: capture time of the view that showed it.
        """
        noise = np.eye(2) * self._config.cut_std_m**2
        self._count += 1
        track = MoverTrack(self._count, place_m, noise, time_s, self._config)
        track.assume(velocity_mps)
        self._tracks.append(track)
        self._moved_s = time_s

    def may_be_at(self, place_m: Floats, time_s: float) -> bool:
        """Return whether a known mover may be at a place, (2,) in the map's frame, at a time.

        A mover that just left the view may be at any place near the drone.
        """
        return any(
            time_s - mover.seen_s > self._config.lost_s
            or math.dist(place_m, (mover.x_m, mover.y_m)) <= mover.std_m + self._config.same_m
            for mover in self.movers(time_s)
        )

    def _drop_found_again(self, time_s: float) -> None:
        """Drop, for each new mover, the nearest one out of view that it may have been before."""
        for found in [each for each in self._tracks if each.moves and each.seen_s == time_s]:
            if found.replaces_lost:
                continue
            lost = [
                each
                for each in self._tracks
                if each.seen_s <= found.first_s
                and time_s - each.seen_s > self._config.carry_s
                and math.dist(found.first_m, each.seen_m)
                <= self._turned_mps(each) * (found.first_s - each.seen_s) + self._config.same_m
            ]
            if lost:
                found.replaces_lost = True
                nearest = min(lost, key=lambda each: math.dist(found.first_m, each.seen_m))
                self._tracks.remove(nearest)

    def _turned_mps(self, track: MoverTrack) -> float:
        """Return the speed at which a mover out of view may go anywhere."""
        cfg = self._config
        return max(cfg.turned_ratio * float(np.hypot(*track.velocity_mps)), cfg.turned_mps)

    def places_m(self) -> Floats:
        """Return the positions of all tracks, (K, 2) in the map's frame: predicted, or the last."""
        carry_s = self._config.carry_s
        places_m = [
            track.place_m if track.time_s - track.seen_s <= carry_s else track.seen_m
            for track in self._tracks
        ]
        return np.array(places_m).reshape(-1, 2)

    def may_move_m(self, time_s: float) -> Floats:
        """Return the movers and possible movers in a view, (K, 2) in the map's frame.

        After a recent movement, an obstacle that has arrived and stands may be a waiting mover.

        Args:
            time_s: capture time of the view.
        """
        cfg = self._config
        least = cfg.sightings if time_s - self._moved_s <= cfg.waits_s else math.inf
        shown = [
            one.place_m
            for one in self._tracks
            if one.seen_s == time_s and (one.moves or one.sightings >= least)
        ]
        return np.array(shown).reshape(-1, 2)

    def forget_free(self, free: Flags, time_s: float) -> None:
        """Forget tracks at whose predicted positions views show ground.

        Args:
            free: (K,) entries of `places_m` at which a view showed ground.
            time_s: capture time of the view.
        """
        kept: list[MoverTrack] = []
        for track, is_free in zip(self._tracks, free, strict=True):
            if not is_free:
                track.free_since_s = None
            elif track.free_since_s is None:
                track.free_since_s = time_s
            gone = track.free_since_s is not None and (
                time_s - track.free_since_s >= self._config.free_s
            )
            if not gone:
                kept.append(track)
        self._tracks = kept

    def passed_over(self, points_m: Floats, first_s: Floats) -> Flags:
        """Return which points of the map belong to a mover, (N,).

        A mover was at the place of these points when they were first seen.

        Args:
            points_m: (N, 2) in the map's frame.
            first_s: (N,) times of the first sightings.
        """
        passed = np.zeros(len(points_m), dtype=bool)
        for track in self._tracks:
            if track.moves:
                for time_s, x_m, y_m in track.trail:
                    near = np.hypot(*(points_m - (x_m, y_m)).T) <= track.radius_m
                    passed |= near & (np.abs(first_s - time_s) <= self._config.passed_s)
        return passed

    def trails_m(self) -> Floats:
        """Return recent positions of movers and their radii, (K, 3) in the map's frame."""
        past = [
            (x_m, y_m, track.radius_m)
            for track in self._tracks
            if track.moves
            for _, x_m, y_m in track.trail
        ]
        return np.array(past).reshape(-1, 3)

    def movers(self, time_s: float) -> tuple[MapMover, ...]:
        """Return the movers at a time, oldest first; those that stopped may go on out of view.

        Args:
            time_s: the time, not before the newest view.
        """
        cfg = self._config
        return tuple(
            self._map_mover(track, time_s)
            for track in self._tracks
            if time_s - track.seen_s <= cfg.life_s
            and (track.moves or (track.has_moved and time_s - track.seen_s > cfg.carry_s))
        )

    def _map_mover(self, track: MoverTrack, time_s: float) -> MapMover:
        place_m, velocity_mps = track.place_m, track.velocity_mps
        place_m = place_m + (time_s - track.time_s) * velocity_mps
        std_m, std_mps, unseen_s = track.std(0), track.std(1), time_s - track.seen_s
        if unseen_s > self._config.carry_s:
            std_mps = self._turned_mps(track)
            place_m, velocity_mps, std_m = track.seen_m, np.zeros(2), std_mps * unseen_s
        return MapMover(
            id=track.number,
            x_m=float(place_m[0]),
            y_m=float(place_m[1]),
            x_mps=float(velocity_mps[0]),
            y_mps=float(velocity_mps[1]),
            std_m=std_m,
            std_mps=std_mps,
            radius_m=track.radius_m,
            first_s=track.first_s,
            seen_s=track.seen_s,
        )

    def _clusters(self, points_m: Floats, from_m: Floats, cut: Flags) -> list[_Cluster]:
        cfg = self._config
        if len(points_m) < max(cfg.min_points, 2):
            return []
        labels = clusters(np.ascontiguousarray(points_m), cfg.apart_m)
        found = []
        for label in range(labels.max() + 1):
            rows = np.flatnonzero(labels == label)
            members = points_m[rows]
            width_m = float(np.hypot(*np.ptp(members, axis=0)))
            if len(rows) < cfg.min_points or width_m > cfg.max_width_m:
                continue
            front_m = members.mean(axis=0)
            range_m = max(math.dist(front_m, from_m), 0.1)
            place_m = front_m + cfg.depth_m / 2 * (front_m - from_m) / range_m
            whole = not cut[rows].any()
            std_m = cfg.std_m if whole else cfg.cut_std_m
            noise = np.eye(2) * (std_m**2 + (cfg.range_std_ratio * range_m) ** 2)
            found.append(_Cluster(place_m, noise, width_m / 2, rows, whole))
        return found

    def _assigned(self, clusters: list[_Cluster]) -> list[tuple[_Cluster, MoverTrack | None]]:
        """Return each cluster with the track that it belongs to."""
        if not clusters or not self._tracks:
            return [(cluster, None) for cluster in clusters]
        costs = np.array(
            [
                [track.distance(cluster.place_m, cluster.noise) for track in self._tracks]
                for cluster in clusters
            ]
        )
        costs[costs > self._config.gate] = _FAR
        owners: list[MoverTrack | None] = [None] * len(clusters)
        for row, column in zip(*linear_sum_assignment(costs), strict=True):
            if costs[row, column] < _FAR:
                owners[row] = self._tracks[column]
        return list(zip(clusters, owners, strict=True))
