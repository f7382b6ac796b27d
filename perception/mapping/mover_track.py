"""One cluster of bases that has arrived on free ground: where it is, and whether it moves.

A Kalman filter predicts the cluster. A straight line through its last places decides: a base that
moves keeps to the line, while the base of a standing thing jumps between its legs and edges. The
numbers were chosen on flights among people, carts, chairs and tables in the twin.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from filterpy.common import Q_discrete_white_noise
from filterpy.kalman import KalmanFilter

from uav_bt.types.arrays import Floats

MIN_RADIUS_M: Final = 0.25
SHRINKS: Final = 0.98  # ratio by which the radius may shrink from one sighting to the next
ACCEL_MPS2: Final = 0.5  # standard deviation of the acceleration; movers start and stop
START_MPS: Final = 0.5  # standard deviation of a new cluster's velocity

EARLY_SIGHTINGS: Final = 3  # sightings after which a fast cluster most likely moves
EARLY_SURE: Final = 2.0  # a velocity above this many standard deviations of the filter is fast
SIGHTINGS: Final = 6  # sightings that a line needs within `NEAR_M` of the camera
FAR_SIGHTINGS: Final = 9  # the same further away, where there is time to see more of it
LINE_S: Final = 1.5  # the line goes through the places of this time
LINE_STD_M: Final = 0.05  # largest standard deviation of the places beside the line
LINE_SURE: Final = 9.0  # least ratio of its speed to the standard deviation of the speed
LOST_SURE: Final = 6.0  # the same for a cluster that comes below the view
MOVED_M: Final = 0.3  # distance from its first place after which a cluster may be a mover
MOVED_NEAR_M: Final = 0.2  # the same within `NEAR_M` of the camera
# A wide thing shows one part after another: more of that distance for each metre of radius.
WIDTH_RATIO: Final = 2.0
NEAR_M: Final = 1.2
LOST_M: Final = 0.05  # distance for one that comes below the view
LOST_S: Final = 0.2  # a cluster unseen for this time has left the view
# A standing edge at some height seems to move against the camera: by this ratio at most, which is
# that of an edge at 0.6 m seen from 1.5 m.
PARALLAX: Final = 0.7
MIN_MPS: Final = 0.15
MAX_MPS: Final = 1.5
STAYS_M: Final = 0.2  # a cluster within this distance of one place for `STAYS_S` stands
STAYS_S: Final = 3.0
TRAIL_S: Final = 3.0  # past places of a mover are kept for this long


class MoverTrack:
    """Position and velocity of a cluster of bases, and whether it moves or stands.

    A sighting states its middle, (2,) in the map's frame, the covariance of that, m2, the position
    of the camera, and whether the view shows the whole of it.
    """

    def __init__(
        self,
        number: int,
        place_m: Floats,
        noise: Floats,
        from_m: Floats,
        time_s: float,
        *,
        whole: bool,
    ) -> None:
        self.number, self.first_m, self.is_whole = number, place_m, whole
        self.filter = KalmanFilter(dim_x=4, dim_z=2)  # x, its velocity, y, its velocity
        self.filter.H = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]])
        self.first_s = self.seen_s = self.time_s = time_s
        self.free_since_s = math.inf  # views show ground at its place since then
        self.radius_m = MIN_RADIUS_M
        self.sightings = 1
        self.moves = self.stands = self.has_moved = False
        self.replaces_lost = False  # it was another track before it left the view
        self.trail: list[tuple[float, float, float]] = []  # s, x, y
        self._begin(place_m, noise, from_m)

    def _begin(self, place_m: Floats, noise: Floats, from_m: Floats) -> None:
        self.filter.x = np.array([[place_m[0]], [0.0], [place_m[1]], [0.0]])
        self.filter.P = np.diag([0.0, START_MPS**2, 0.0, START_MPS**2])
        self.filter.P[np.ix_([0, 2], [0, 2])] = noise
        self.seen_m, self.stands = place_m, False
        self._line: list[tuple[float, float, float]] = []  # s, x, y
        self._wait(from_m)

    def _wait(self, from_m: Floats) -> None:
        """Judge movement from the present place on."""
        self._begin_m = self._anchor_m = self.place_m
        self._from_m, self._anchor_s = from_m, self.time_s

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
    def _wider_m(self) -> float:
        """How much further a wide thing must have moved."""
        return WIDTH_RATIO * (self.radius_m - MIN_RADIUS_M)

    @property
    def is_under_way(self) -> bool:
        """Whether it moves, certainly or most likely."""
        speed_mps = float(np.hypot(*self.velocity_mps))
        fast = speed_mps >= max(MIN_MPS, EARLY_SURE * self.std(1)) and not self.stands
        return self.moves or (fast and self.sightings >= EARLY_SIGHTINGS)

    def predict(self, time_s: float) -> None:
        """Predict its state at a time."""
        step_s = time_s - self.time_s
        if step_s <= 0.0:
            return
        self.filter.F = np.kron(np.eye(2), [[1.0, step_s], [0.0, 1.0]])
        noise = Q_discrete_white_noise(2, step_s, ACCEL_MPS2**2, block_size=2)
        self.filter.predict(Q=noise)
        self.time_s = time_s

    def distance(self, place_m: Floats, noise: Floats) -> float:
        """Return the squared Mahalanobis distance of a sighting."""
        residual = place_m - self.place_m
        spread = self.filter.P[np.ix_([0, 2], [0, 2])] + noise
        return float(residual @ np.linalg.solve(spread, residual))

    def sight(
        self, place_m: Floats, noise: Floats, from_m: Floats, radius_m: float, *, whole: bool
    ) -> None:
        """Update the track with a sighting at the time of the last prediction."""
        if whole and not self.is_whole and not self.moves:  # restart: earlier middles were of parts
            self._begin(place_m, noise, from_m)
        else:
            self.filter.update(place_m.reshape(2, 1), R=noise)
        self._line.append((self.time_s, float(place_m[0]), float(place_m[1])))
        self.is_whole |= whole
        self.seen_m = self.place_m
        self.seen_s, self.sightings, self.free_since_s = self.time_s, self.sightings + 1, math.inf
        # The visible part changes with its place in the view.
        self.radius_m = max(MIN_RADIUS_M, radius_m, SHRINKS * self.radius_m)

    def judge(self, from_m: Floats, *, moves: bool = True) -> None:
        """Decide whether it moves or stands; judging restarts where the view shows no movement."""
        place_m = self.place_m
        if not moves:
            self._wait(from_m)
            self._line = []
            return
        if math.dist(place_m, self._anchor_m) > STAYS_M:
            self._anchor_m, self._anchor_s = place_m, self.time_s
            self.stands = False
        elif self.time_s - self._anchor_s >= STAYS_S:
            if not self.stands:
                self._begin_m, self._from_m = place_m, from_m
            self.moves, self.stands = False, True
        is_near = math.dist(place_m, from_m) < NEAR_M
        least, enough_m = (SIGHTINGS, MOVED_NEAR_M) if is_near else (FAR_SIGHTINGS, MOVED_M)
        far = self._has_come(place_m, from_m, enough_m + self._wider_m)
        if far and self._keeps_to_line(LINE_SURE, least):
            self.moves, self.stands, self.has_moved = True, False, True
        if self.moves:
            self.trail.append((self.time_s, float(place_m[0]), float(place_m[1])))
            oldest_s = self.time_s - TRAIL_S
            self.trail = [past for past in self.trail if past[0] >= oldest_s]

    def _has_come(self, place_m: Floats, from_m: Floats, least_m: float) -> bool:
        """Return whether it has come to a place by more than the camera's own way explains."""
        moved_m, flown_m = place_m - self._begin_m, from_m - self._from_m
        against = -float(moved_m @ flown_m) / max(float(flown_m @ flown_m), 1e-6)
        moved_m = moved_m + min(max(against, 0.0), PARALLAX) * flown_m
        return bool(self.is_whole and np.hypot(*moved_m) >= least_m)

    def _keeps_to_line(self, sure: float, sightings: int = SIGHTINGS) -> bool:
        """Return whether it keeps to a line, at a speed of `sure` standard deviations or more."""
        self._line = [place for place in self._line if place[0] >= self.seen_s - LINE_S]
        if len(self._line) < sightings:
            return False
        times_s, places_m = np.array(self._line)[:, 0], np.array(self._line)[:, 1:]
        times_s, places_m = times_s - times_s.mean(), places_m - places_m.mean(axis=0)
        spread_s2 = float(times_s @ times_s)
        velocity_mps = times_s @ places_m / spread_s2
        rest_m = places_m - np.outer(times_s, velocity_mps)
        std_m = max(math.sqrt(float((rest_m**2).sum()) / (2 * len(times_s) - 4)), 1e-3)
        speed_mps = float(np.hypot(*velocity_mps))
        return bool(
            std_m <= LINE_STD_M
            and MIN_MPS <= speed_mps <= MAX_MPS
            and speed_mps * math.sqrt(spread_s2) >= sure * std_m
        )

    def leave(self, from_m: Floats, time_s: float) -> None:
        """Take a cluster for a mover that has come below the view before it moved far enough."""
        lost, near = time_s - self.seen_s > LOST_S, math.dist(self.seen_m, from_m) < NEAR_M
        far = self._has_come(self.seen_m, from_m, self._wider_m + LOST_M)
        if lost and near and far and not self.stands and self._keeps_to_line(LOST_SURE):
            self.moves = self.has_moved = True
