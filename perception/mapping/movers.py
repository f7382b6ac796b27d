"""Tracker of moving obstacles, which separates them from standing ones.

Bases that appear on ground that was seen free before, away from settled points, have arrived. They
are clustered in each view, and each cluster is tracked in the map's frame. A cluster is a mover
after it has moved further than the noise of depth and odometry. It stands after it has stayed at
one place for some seconds, or is low. The numbers were chosen on the twin's people and carts.

A point that is seen again is displaced by the map's drift and by the errors of height and pitch. A
new point near a settled point is therefore that obstacle again. Views fit the map by 0.02 m in the
mean, 0.03 to 0.08 m with the network `any`. The distances of arrivals were chosen on flights
without and with slow movers: with larger ones a mover at 0.2 m/s counts as a standing obstacle.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment
from scipy.spatial.distance import cdist

from perception.mapping.ground_grid import GroundGrid
from perception.mapping.landmarks import Landmarks, clusters, nearest_circles
from perception.mapping.mover_track import LOST_S, SIGHTINGS, MoverTrack
from uav_bt.types import Pose2D
from uav_bt.types.arrays import Flags, Floats
from uav_bt.types.site_map import MapMover

LIFE_S: Final = 6.0  # a mover is forgotten after this time unseen
# A mover out of view keeps its velocity for this time. After it the mover may have turned: it is
# anywhere within the way that it covers at `TURNED_RATIO` of its speed.
MOVER_CARRY_S: Final = 0.6
TURNED_RATIO: Final = 1.5
TURNED_MPS: Final = 0.5  # least speed for that way; a mover that turns is measured too slow
WAITS_S: Final = 90.0  # after a movement, what has arrived may be a waiting mover for this time

_APART_M: Final = 0.3  # points further apart belong to two clusters
_MIN_POINTS: Final = 3  # a cluster with fewer points is ignored
_TALL_POINTS: Final = 0.5  # a cluster with a smaller share of tall points stands; chosen
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
_PASSED_S: Final = 1.0  # a mover was at points of the map that were first seen within this time
_FAR: Final = 1e6  # cost of a pair that must not be assigned

SETTLES_S: Final = 2.0  # a point on ground that was seen before settles after this time
_BESIDE_M: Final = 0.15  # a point this near to a settled point belongs to it
_BESIDE_NEW_M: Final = 0.1  # the same for a point that has just settled
_BESIDE_MPS: Final = 0.04  # growth from one to the other
# A point that a mover owns may be this much nearer to settled points. Less than `_BESIDE_NEW_M`, so
# that the points of a box that a mover passes stay those of the box.
_SHARED_M: Final = 0.05

# A base this near to a point of its class, settled so long ago, is of that obstacle. Chosen.
_OWN_M: Final = 0.3
_OWN_S: Final = 5.0

ALONG_BEARING_M: Final = 0.1  # between the tested places on a bearing
HIDDEN_M: Final = 0.9  # assumed distance of a hidden arrival's middle from the body's centre
HIDDEN_MPS: Final = 0.5  # its assumed speed, towards the drone
_FROM_M: Final = 0.4  # nearest tested distance; a nearer obstacle would touch the body
_TO_M: Final = 1.1  # farthest tested distance; ground further away need not have been seen free
_KNOWN_M: Final = 0.3  # a place this near to an obstacle of the map belongs to it
_BEARINGS: Final = 3  # least number of bearings, a degree apart; fewer are specks of the class map


def find_arrivals(seen: Landmarks, known: Landmarks, on_ground: Flags, owned: Flags) -> Flags:
    """Return which bases of a view have arrived, (N,): on ground seen before, or of a mover."""
    if not len(seen):
        return np.zeros(0, dtype=bool)
    time_s = float(seen.seen_s[0])
    settled = (known.settled_s <= time_s) & (known.missed == 0.0)
    lasts_s = time_s - known.settled_s[settled]
    reach_m = np.minimum(_BESIDE_M, _BESIDE_NEW_M + _BESIDE_MPS * lasts_s)
    off_m = nearest_circles(seen.xy_m, known.xy_m[settled], reach_m)[0]
    return np.asarray((on_ground & (off_m > 0.0)) | (owned & (off_m > -_SHARED_M)))


def are_of_known(seen: Landmarks, known: Landmarks, time_s: float) -> Flags:
    """Return which bases are of an old obstacle, seen from another side by a drifted map, (N,)."""
    old = known.take(known.settled_s <= time_s - _OWN_S)
    near = cdist(seen.xy_m, old.xy_m) <= _OWN_M
    return np.asarray((near & (seen.ids[:, None] == old.ids)).any(axis=1))


def hidden_arrival(
    hidden_m: Floats, pose: Pose2D, grid: GroundGrid, known_m: Floats
) -> Floats | None:
    """Return the direction, (2,) on the map, of what has arrived with its base below the view.

    A camera that looks ahead shows no base nearer than about 1.3 m. A mover that comes from the
    side or turns a corner may be nearer when it comes into view. It then covers ground that was
    seen free before and where the map has no obstacle: no point of `known_m`, (M, 2). `hidden_m`,
    (N, 2) from the body's centre, is the nearest ground on the bearings of such obstacles.
    """
    if len(hidden_m) < _BEARINGS:
        return None
    ends_m = np.hypot(*hidden_m.T)
    ranges_m = np.arange(_FROM_M, ends_m.max() + ALONG_BEARING_M, ALONG_BEARING_M)
    ahead = hidden_m / ends_m[:, None]
    places_m = pose.points_to_world((ahead[:, None] * ranges_m[:, None]).reshape(-1, 2))
    shape = len(hidden_m), len(ranges_m)
    free = grid.was_ground(places_m).reshape(shape) | (ranges_m > _TO_M)
    if len(known_m):
        apart_m = np.hypot(*np.moveaxis(places_m[:, None] - known_m, -1, 0)).min(axis=1)
        free &= (apart_m > _KNOWN_M).reshape(shape)
    covers = (free | (ranges_m > ends_m[:, None])).all(axis=1)
    if covers.sum() < _BEARINGS:
        return None
    middle = np.median(ahead[covers], axis=0, keepdims=True)
    (towards_m,) = pose.points_to_world(middle) - (pose.x_m, pose.y_m)
    return np.asarray(towards_m / np.hypot(*towards_m))


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
        """Forget all tracks, whose places are of an abandoned map; numbers go on."""
        self._tracks = []

    def predict(self, time_s: float) -> None:
        """Predict all tracks up to a time."""
        for track in self._tracks:
            track.predict(time_s)

    def owns(self, points_m: Floats) -> Flags:
        """Return which points lie on a mover in view, (N,), at the time of the last prediction."""
        owned = np.zeros(len(points_m), dtype=bool)
        for track in self._tracks:
            if track.is_under_way and track.time_s - track.seen_s <= MOVER_CARRY_S:
                apart_m = np.hypot(*(points_m - track.place_m).T)
                owned |= apart_m <= track.radius_m + _OWNED_M
        return owned

    def follow(
        self,
        points_m: Floats,
        from_m: Floats,
        time_s: float,
        *,
        cut: Flags | None = None,
        tall: Flags | None = None,
        judges: bool = True,
    ) -> Flags:
        """Track the arrived points of a view from the camera at `from_m`; return which stand, (N,).

        `cut` are points beside which the obstacle may continue, `tall` those of tall obstacles:
        others stand, unless they have moved before. `judges` states whether the view may show
        movement.
        """
        self._tracks = [
            track
            for track in self._tracks
            if time_s - track.seen_s <= (LIFE_S if track.has_moved else _DOUBT_S)
        ]
        self.predict(time_s)
        stands = np.zeros(len(points_m), dtype=bool)
        cut = np.zeros(len(points_m), dtype=bool) if cut is None else cut
        tall = np.ones(len(points_m), dtype=bool) if tall is None else tall
        for cluster, owner in self._assigned(_clusters(points_m, from_m, cut)):
            place_m, noise, radius_m, rows, whole = cluster
            if tall[rows].mean() < _TALL_POINTS and not (owner and owner.has_moved):
                stands[rows] = True
                if owner is not None:
                    owner.judge(from_m, moves=False)
            elif owner is not None:
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
        """Add a mover that was not seen to move, with its assumed place and velocity, (2,)."""
        track = self._start(place_m, np.eye(2) * _CUT_STD_M**2, place_m, time_s, whole=True)
        track.filter.x[[1, 3], 0] = velocity_mps
        track.moves = track.has_moved = True
        self.moved_s = time_s

    def may_be_at(self, place_m: Floats, time_s: float) -> bool:
        """Return whether a mover may be at a place, (2,); one just out of view may be at any."""
        return any(
            time_s - mover.seen_s > LOST_S
            or math.dist(place_m, (mover.x_m, mover.y_m)) <= mover.std_m + _SAME_M
            for mover in self.movers(time_s)
        )

    def _drop_found_again(self, time_s: float) -> None:
        """Drop, for each new mover, the nearest one out of view that it may have been before."""
        seen = [one for one in self._tracks if one.moves and one.seen_s == time_s]
        for found in (one for one in seen if not one.replaces_lost):
            lost = [
                each
                for each in self._tracks
                if each.seen_s <= found.first_s
                and time_s - each.seen_s > MOVER_CARRY_S
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
            track.place_m if track.time_s - track.seen_s <= MOVER_CARRY_S else track.seen_m
            for track in self._tracks
        ]
        return np.array(places_m).reshape(-1, 2)

    def may_move_m(self, time_s: float) -> Floats:
        """Return the movers in a view, (K, 2); after a movement also what may be a waiting one."""
        least = SIGHTINGS if time_s - self.moved_s <= WAITS_S else math.inf
        shown = [
            one.place_m
            for one in self._tracks
            if one.seen_s == time_s and (one.moves or one.sightings >= least)
        ]
        return np.array(shown).reshape(-1, 2)

    def forget_free(self, free: Flags, time_s: float) -> None:
        """Forget tracks of whose `places_m` views show ground; `free`, (K,), is of one view."""
        for track, is_free in zip(self._tracks, free, strict=True):
            track.free_since_s = min(track.free_since_s, time_s) if is_free else math.inf
        self._tracks = [one for one in self._tracks if time_s - one.free_since_s < _FREE_S]

    def passed_over(self, points_m: Floats, first_s: Floats) -> Flags:
        """Return which points of the map a mover was at when they were first seen, (N,)."""
        passed = np.zeros(len(points_m), dtype=bool)
        for track in self._tracks:
            if track.moves:
                for time_s, x_m, y_m in track.trail:
                    near = np.hypot(*(points_m - (x_m, y_m)).T) <= track.radius_m
                    passed |= near & (np.abs(first_s - time_s) <= _PASSED_S)
        return passed

    def trails_m(self) -> Floats:
        """Return recent positions of movers and their radii, (K, 3) in the map's frame."""
        moving = [track for track in self._tracks if track.moves]
        past = [(x_m, y_m, track.radius_m) for track in moving for _, x_m, y_m in track.trail]
        return np.array(past).reshape(-1, 3)

    def movers(self, time_s: float) -> tuple[MapMover, ...]:
        """Return the movers at a time, oldest first; those that stopped may go on out of view."""
        return tuple(
            _map_mover(track, time_s)
            for track in self._tracks
            if time_s - track.seen_s <= LIFE_S
            and (track.moves or (track.has_moved and time_s - track.seen_s > MOVER_CARRY_S))
        )

    def _assigned(self, found: list[_Cluster]) -> list[tuple[_Cluster, MoverTrack | None]]:
        """Return each cluster with the track that it belongs to."""
        if not found or not self._tracks:
            return [(cluster, None) for cluster in found]
        tracks = self._tracks
        costs = np.array([[one.distance(it.place_m, it.noise) for one in tracks] for it in found])
        costs[costs > _GATE] = _FAR
        owners: list[MoverTrack | None] = [None] * len(found)
        for row, column in zip(*linear_sum_assignment(costs), strict=True):
            if costs[row, column] < _FAR:
                owners[row] = tracks[column]
        return list(zip(found, owners, strict=True))


def _turned_mps(track: MoverTrack) -> float:
    """Return the speed at which a mover out of view may go anywhere."""
    return max(TURNED_RATIO * float(np.hypot(*track.velocity_mps)), TURNED_MPS)


def _map_mover(track: MoverTrack, time_s: float) -> MapMover:
    place_m, velocity_mps = track.place_m, track.velocity_mps
    place_m = place_m + (time_s - track.time_s) * velocity_mps
    std_m, std_mps, unseen_s = track.std(0), track.std(1), time_s - track.seen_s
    if unseen_s > MOVER_CARRY_S:
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
