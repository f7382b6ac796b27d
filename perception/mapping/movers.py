"""Tracker of moving obstacles, which separates them from standing ones.

Bases that appear on ground that was seen free before, away from settled points, have arrived. They
are clustered in each view, and each cluster is tracked in the map's frame. A cluster is a mover
after it has moved further than the noise of depth and odometry. It stands after it has stayed at
one place for some seconds. The numbers were chosen on the twin's people and carts.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from perception.mapping.landmarks import clusters
from perception.mapping.mover_track import LOST_S, SIGHTINGS, MoverTrack
from uav_bt.types.arrays import Flags, Floats
from uav_bt.types.site_map import MapMover

LIFE_S: Final = 6.0  # a mover is forgotten after this time unseen
# A mover out of view keeps its velocity for this time. After it the mover may have turned: it is
# anywhere within the way that it covers at `TURNED_RATIO` of its speed.
CARRY_S: Final = 0.6
TURNED_RATIO: Final = 1.5
TURNED_MPS: Final = 0.5  # least speed for that way; a mover that turns is measured too slow
WAITS_S: Final = 90.0  # after a movement, what has arrived may be a waiting mover for this time

_APART_M: Final = 0.3  # points further apart belong to two clusters
_MIN_POINTS: Final = 3  # a cluster with fewer points is ignored
_MAX_WIDTH_M: Final = 1.2  # a wider cluster is a wall that a displaced view shows
# A mover's assumed depth. Its base is seen from one side, and its middle lies behind.
_DEPTH_M: Final = 0.4
_STD_M: Final = 0.06  # standard deviation of a cluster's middle
_CUT_STD_M: Final = 0.3  # the same where the obstacle may continue beside the cluster
_RANGE_STD_RATIO: Final = 0.02  # the same as a ratio of its range, in addition
_GATE: Final = 13.8  # largest squared Mahalanobis distance; chi-square, 2 dof, 99.9 %
_SAME_M: Final = 0.45  # a cluster this near to a track starts no other
_OWNED_M: Final = 0.15  # points this near to the circle of a mover belong to it
_DOUBT_S: Final = 0.6  # a cluster that has not moved is forgotten after this time unseen
_FREE_S: Final = 0.3  # a track is forgotten when its place is seen free for this long
# A point of the map belongs to a mover that was there within this time of its first sighting.
_PASSED_S: Final = 1.0
_FAR: Final = 1e6  # cost of a pair that must not be assigned


class _Cluster(NamedTuple):
    place_m: Floats  # (2,) its middle
    noise: Floats  # (2, 2) covariance of the middle, m2
    radius_m: float
    rows: NDArray[np.intp]  # indices of its points
    whole: bool  # the view shows all of it


class MoverTracker:
    """Tracks clusters that have arrived on free ground."""

    def __init__(self) -> None:
        self._tracks: list[MoverTrack] = []
        self._count = 0
        self.moved_s = -math.inf  # time of the last seen movement

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
            if track.is_under_way and track.time_s - track.seen_s <= CARRY_S:
                owned |= track.holds(points_m, _OWNED_M)
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
            cut: (N,) points beside which the obstacle may continue; default: none.
            judges: whether the view may show movement.

        Returns:
            (N,) points of clusters that have stayed long enough to stand.
        """
        self._tracks = [
            track
            for track in self._tracks
            if time_s - track.seen_s <= (LIFE_S if track.has_moved else _DOUBT_S)
        ]
        self.predict(time_s)
        stands = np.zeros(len(points_m), dtype=bool)
        cut = np.zeros(len(points_m), dtype=bool) if cut is None else cut
        for cluster, owner in self._assigned(_clusters(points_m, from_m, cut)):
            place_m, noise, radius_m, rows, whole = cluster
            if owner is not None:
                owner.sight(place_m, noise, from_m, radius_m, whole=whole)
                owner.judge(from_m, moves=judges)
                stands[rows] = owner.stands
                if owner.moves:
                    self.moved_s = time_s
            elif all(math.dist(place_m, other.place_m) >= _SAME_M for other in self._tracks):
                self._start(place_m, noise, from_m, time_s, whole=whole)
        for track in self._tracks if judges else ():
            track.leave(from_m, time_s)
        self._drop_found_again(time_s)
        return stands

    def _start(
        self, place_m: Floats, noise: Floats, from_m: Floats, time_s: float, *, whole: bool
    ) -> MoverTrack:
        self._count += 1
        self._tracks.append(MoverTrack(self._count, place_m, noise, from_m, time_s, whole=whole))
        return self._tracks[-1]

    def meet(self, place_m: Floats, velocity_mps: Floats, time_s: float) -> None:
        """Add a mover that was not seen to move.

        Args:
            place_m: (2,) its assumed middle, in the map's frame.
            velocity_mps: (2,) its assumed velocity.
            time_s: capture time of the view that showed it.
        """
        track = self._start(place_m, np.eye(2) * _CUT_STD_M**2, place_m, time_s, whole=True)
        track.assume(velocity_mps)
        self.moved_s = time_s

    def may_be_at(self, place_m: Floats, time_s: float) -> bool:
        """Return whether a known mover may be at a place, (2,) in the map's frame, at a time.

        A mover that just left the view may be at any place near the drone.
        """
        return any(
            time_s - mover.seen_s > LOST_S
            or math.dist(place_m, (mover.x_m, mover.y_m)) <= mover.std_m + _SAME_M
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
                and time_s - each.seen_s > CARRY_S
                and math.dist(found.first_m, each.seen_m)
                <= _turned_mps(each) * (found.first_s - each.seen_s) + _SAME_M
            ]
            if lost:
                found.replaces_lost = True
                nearest = min(lost, key=lambda each: math.dist(found.first_m, each.seen_m))
                self._tracks.remove(nearest)

    def places_m(self) -> Floats:
        """Return the positions of all tracks, (K, 2) in the map's frame: predicted, or the last."""
        places_m = [
            track.place_m if track.time_s - track.seen_s <= CARRY_S else track.seen_m
            for track in self._tracks
        ]
        return np.array(places_m).reshape(-1, 2)

    def may_move_m(self, time_s: float) -> Floats:
        """Return the movers and possible movers in a view, (K, 2) in the map's frame.

        After a recent movement, an obstacle that has arrived and stands may be a waiting mover.

        Args:
            time_s: capture time of the view.
        """
        least = SIGHTINGS if time_s - self.moved_s <= WAITS_S else math.inf
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
            if track.free_since_s is None or time_s - track.free_since_s < _FREE_S:
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
                    passed |= near & (np.abs(first_s - time_s) <= _PASSED_S)
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
        return tuple(
            _map_mover(track, time_s)
            for track in self._tracks
            if time_s - track.seen_s <= LIFE_S
            and (track.moves or (track.has_moved and time_s - track.seen_s > CARRY_S))
        )

    def _assigned(self, found: list[_Cluster]) -> list[tuple[_Cluster, MoverTrack | None]]:
        """Return each cluster with the track that it belongs to."""
        if not found or not self._tracks:
            return [(cluster, None) for cluster in found]
        costs = np.array(
            [
                [track.distance(cluster.place_m, cluster.noise) for track in self._tracks]
                for cluster in found
            ]
        )
        costs[costs > _GATE] = _FAR
        owners: list[MoverTrack | None] = [None] * len(found)
        for row, column in zip(*linear_sum_assignment(costs), strict=True):
            if costs[row, column] < _FAR:
                owners[row] = self._tracks[column]
        return list(zip(found, owners, strict=True))


def _turned_mps(track: MoverTrack) -> float:
    """Return the speed at which a mover out of view may go anywhere."""
    return max(TURNED_RATIO * float(np.hypot(*track.velocity_mps)), TURNED_MPS)


def _map_mover(track: MoverTrack, time_s: float) -> MapMover:
    place_m, velocity_mps = track.place_m, track.velocity_mps
    place_m = place_m + (time_s - track.time_s) * velocity_mps
    std_m, std_mps, unseen_s = track.std(0), track.std(1), time_s - track.seen_s
    if unseen_s > CARRY_S:
        std_mps = _turned_mps(track)
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


def _clusters(points_m: Floats, from_m: Floats, cut: Flags) -> list[_Cluster]:
    """Return the clusters of the points of a view."""
    if len(points_m) < _MIN_POINTS:
        return []
    labels = clusters(np.ascontiguousarray(points_m), _APART_M)
    found = []
    for label in range(labels.max() + 1):
        rows = np.flatnonzero(labels == label)
        members = points_m[rows]
        width_m = float(np.hypot(*np.ptp(members, axis=0)))
        if len(rows) < _MIN_POINTS or width_m > _MAX_WIDTH_M:
            continue
        front_m = members.mean(axis=0)
        range_m = max(math.dist(front_m, from_m), 0.1)
        place_m = front_m + _DEPTH_M / 2 * (front_m - from_m) / range_m
        whole = not cut[rows].any()
        std_m = _STD_M if whole else _CUT_STD_M
        noise = np.eye(2) * (std_m**2 + (_RANGE_STD_RATIO * range_m) ** 2)
        found.append(_Cluster(place_m, noise, width_m / 2, rows, whole))
    return found
