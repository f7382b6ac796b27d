"""Kalman filter that tracks one cluster of bases that has arrived on free ground."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from filterpy.common import Q_discrete_white_noise
from filterpy.kalman import KalmanFilter

from uav_bt.errors import ValueRangeError
from uav_bt.types.arrays import Flags, Floats


@dataclass(frozen=True, kw_only=True)
class MoverConfig:
    """When a cluster is a mover, and for how long. Chosen on the twin's people and carts."""

    apart_m: float = 0.3  # points further apart belong to two clusters
    min_points: int = 3  # a cluster with fewer points is ignored
    max_width_m: float = 1.2  # a wider cluster is a wall that a displaced view shows
    # Assumed depth of a mover; its base is seen from one side, its middle lies behind.
    depth_m: float = 0.4
    min_radius_m: float = 0.25  # least radius of a mover
    shrinks: float = 0.98  # ratio by which the radius may shrink from one sighting to the next
    owned_m: float = 0.15  # points this near to the circle of a mover belong to it
    std_m: float = 0.06  # standard deviation of a cluster's middle
    cut_std_m: float = 0.3  # the same where the end of the view cuts the cluster off
    range_std_ratio: float = 0.02  # the same as a ratio of its range, in addition
    accel_mps2: float = 0.5  # standard deviation of the acceleration; movers start and stop
    start_mps: float = 0.5  # standard deviation of a new cluster's velocity
    # Largest squared Mahalanobis distance of a sighting; chi-square, 2 dof, 99.9 %.
    gate: float = 13.8
    same_m: float = 0.45  # a cluster this near to a track starts no other
    early_sightings: int = 3  # sightings after which a fast cluster most likely moves
    sightings: int = 5  # sightings after which a cluster may be a mover
    moved_m: float = 0.3  # distance from its first place after which a fast cluster is a mover
    moved_near_m: float = 0.2  # the same within `near_m` of the camera
    moved_slowly_m: float = 0.45  # the same for a slow one
    min_mps: float = 0.1  # least speed of a mover
    max_mps: float = 1.5  # largest speed of a mover
    sure: float = 2.0  # a cluster is fast above this many standard deviations of its velocity
    stays_m: float = 0.2  # a cluster within this distance of one place for `stays_s` stands
    stays_s: float = 3.0  # time within `stays_m` after which a cluster stands
    doubt_s: float = 0.6  # a cluster that has not moved is forgotten after this time unseen
    # A fast cluster within `near_m` of the camera that is unseen for `lost_s` is a mover, although
    # it has not moved by `moved_m`: its base is below the view.
    lost_s: float = 0.2
    near_m: float = 1.2
    sure_lost: float = 1.0  # `sure` for such a cluster, which was seen for a short time
    life_s: float = 6.0  # a mover is forgotten after this time unseen
    # A mover out of view keeps its velocity for this time. After it the mover may have turned: it
    # is anywhere within the way that it covers at `turned_ratio` of its speed.
    carry_s: float = 0.6
    turned_ratio: float = 1.5
    turned_mps: float = 0.5  # least speed for that way; a mover that turns is measured too slow
    # A cluster or a mover is forgotten when its place is seen free for this long.
    free_s: float = 0.3
    # An obstacle that has arrived may be a waiting mover for this time after any movement.
    waits_s: float = 90.0
    trail_s: float = 3.0  # past places of a mover are kept for this long
    # A point of the map belongs to a mover that was there within this time of the point's first
    # sighting.
    passed_s: float = 1.0

    def __post_init__(self) -> None:
        if not 0.0 < self.min_mps < self.max_mps or self.sightings < 2:
            raise ValueRangeError(f"a mover needs speeds in order and sightings, got {self}")


class MoverTrack:
    """Position and velocity of a cluster of bases, and whether it moves or stands.

    Args:
        number: number of the track.
        place_m: (2,) its middle, in the map's frame.
        noise: (2, 2) covariance of the middle, m2.
        time_s: capture time of the first view that showed it.
        config: when a cluster is a mover.
    """

    def __init__(
        self, number: int, place_m: Floats, noise: Floats, time_s: float, config: MoverConfig
    ) -> None:
        self.number, self._config = number, config
        self.first_m = place_m
        self.filter = KalmanFilter(dim_x=4, dim_z=2)  # x, its velocity, y, its velocity
        self.filter.H = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]])
        self.first_s = self.seen_s = self.time_s = self.anchor_s = time_s
        self._begin(place_m, noise)
        self.free_since_s: float | None = None
        self.radius_m = config.min_radius_m
        self.sightings = 1
        self.moves = self.stands = self.has_moved = False
        self.replaces_lost = False  # it was another track before it left the view
        self.is_whole = True  # it was seen as a whole
        self._was_fast = False  # at the last sighting, by `sure_lost`
        self.trail: list[tuple[float, float, float]] = []  # s, x, y

    def _begin(self, place_m: Floats, noise: Floats) -> None:
        start_mps = self._config.start_mps
        self.filter.x = np.array([[place_m[0]], [0.0], [place_m[1]], [0.0]])
        self.filter.P = np.diag([0.0, start_mps**2, 0.0, start_mps**2])
        self.filter.P[np.ix_([0, 2], [0, 2])] = noise
        self.begin_m = self.anchor_m = self.seen_m = place_m

    @property
    def place_m(self) -> Floats:
        """Its position, (2,) in the map's frame, m."""
        return np.asarray(self.filter.x[[0, 2], 0])

    @property
    def velocity_mps(self) -> Floats:
        """Its velocity, (2,) in the map's frame, m/s."""
        return np.asarray(self.filter.x[[1, 3], 0])

    def std(self, first: int) -> float:
        """Return the larger standard deviation of the position (0) or the velocity (1)."""
        rows = [first, first + 2]
        return float(np.sqrt(np.linalg.eigvalsh(self.filter.P[np.ix_(rows, rows)])[-1]))

    @property
    def is_under_way(self) -> bool:
        """Whether it moves, certainly or most likely."""
        cfg = self._config
        fast = self._is_fast(cfg.sure) and not self.stands
        return self.moves or (fast and self.sightings >= cfg.early_sightings)

    def _is_fast(self, sure: float) -> bool:
        speed_mps = float(np.hypot(*self.velocity_mps))
        return speed_mps >= max(self._config.min_mps, sure * self.std(1))

    def predict(self, time_s: float) -> None:
        """Predict its state at a time."""
        step_s = time_s - self.time_s
        if step_s <= 0.0:
            return
        self.filter.F = np.kron(np.eye(2), [[1.0, step_s], [0.0, 1.0]])
        noise = Q_discrete_white_noise(2, step_s, self._config.accel_mps2**2, block_size=2)
        self.filter.predict(Q=noise)
        self.time_s = time_s

    def distance(self, place_m: Floats, noise: Floats) -> float:
        """Return the squared Mahalanobis distance of a sighting."""
        residual = place_m - self.place_m
        spread = self.filter.P[np.ix_([0, 2], [0, 2])] + noise
        return float(residual @ np.linalg.solve(spread, residual))

    def sight(self, place_m: Floats, noise: Floats, radius_m: float, *, whole: bool = True) -> None:
        """Update the track with a sighting at the time of the last prediction.

        Args:
            place_m: (2,) the middle of the cluster.
            noise: (2, 2) covariance of the middle, m2.
            radius_m: radius of the visible part.
            whole: whether the visible part is the whole.
        """
        cfg = self._config
        if whole and not self.is_whole and not self.moves:  # restart: earlier middles were of parts
            self._begin(place_m, noise)
            self.anchor_s, self.stands = self.time_s, False
        else:
            self.filter.update(place_m.reshape(2, 1), R=noise)
        self.is_whole |= whole
        self.seen_m = self.place_m
        self.seen_s, self.sightings, self.free_since_s = self.time_s, self.sightings + 1, None
        # The visible part changes with its place in the view.
        self.radius_m = max(cfg.min_radius_m, radius_m, cfg.shrinks * self.radius_m)
        self._was_fast = self._is_fast(cfg.sure_lost)  # a prediction makes the velocity uncertain

    def judge(self, from_m: Floats, *, moves: bool = True) -> None:
        """Decide whether it moves or stands.

        Args:
            from_m: (2,) position of the camera in the map's frame.
            moves: whether the sighting may show movement; if not, judging restarts at this place.
        """
        cfg, place_m = self._config, self.place_m
        if not moves:
            self.begin_m = self.anchor_m = place_m
            self.anchor_s = self.time_s
            return
        speed_mps = float(np.hypot(*self.velocity_mps))
        if math.dist(place_m, self.anchor_m) > cfg.stays_m:
            self.anchor_m, self.anchor_s = place_m, self.time_s
            self.stands = False
        elif self.time_s - self.anchor_s >= cfg.stays_s:
            if not self.stands:
                self.begin_m = place_m
            self.moves, self.stands = False, True
        moved_m = math.dist(place_m, self.begin_m)
        is_near = math.dist(place_m, from_m) < cfg.near_m
        if (
            self.sightings >= cfg.sightings
            and moved_m >= (cfg.moved_near_m if is_near else cfg.moved_m)
            and cfg.min_mps <= speed_mps <= cfg.max_mps
            and (speed_mps >= cfg.sure * self.std(1) or moved_m >= cfg.moved_slowly_m)
        ):
            self.moves, self.stands, self.has_moved = True, False, True
        if self.moves:
            self.trail.append((self.time_s, float(place_m[0]), float(place_m[1])))
            oldest_s = self.time_s - cfg.trail_s
            self.trail = [past for past in self.trail if past[0] >= oldest_s]

    def assume(self, velocity_mps: Floats) -> None:
        """Take the cluster for a mover with a velocity, (2,) in the map's frame, m/s."""
        self.filter.x[[1, 3], 0] = velocity_mps
        self.moves = self.has_moved = True

    def leave(self, from_m: Floats, time_s: float) -> None:
        """Take a fast cluster for a mover when it has come below the view.

        Args:
            from_m: (2,) position of the camera in the map's frame.
            time_s: capture time of the newest view.
        """
        cfg = self._config
        known, lost = self.sightings >= cfg.sightings, time_s - self.seen_s > cfg.lost_s
        fast, near = self._was_fast and not self.stands, math.dist(self.seen_m, from_m) < cfg.near_m
        if known and lost and fast and near:
            self.moves = self.has_moved = True

    def holds(self, points_m: Floats, margin_m: float) -> Flags:
        """Return which points are within its circle and a margin around."""
        apart_m = np.hypot(*(points_m - self.place_m).T)
        return np.asarray(apart_m <= self.radius_m + margin_m)
