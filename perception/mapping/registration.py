"""Correction of the drone's pose by scan matching against the map's points.

The transform from the dead-reckoned frame to the map's (REP 105's `odom` to `map`) is the state of
a Kalman filter. Its uncertainty grows with the odometry's drift. Each view is matched to the map by
iterated closest points of the same class (Besl and McKay, 1992). Where the neighbours in the map
form a line, the distance is point to line (Chen and Medioni, 1992). Points have Cauchy weights. The
prediction with its covariance is part of the least squares, so that a single edge corrects the pose
only across the edge.

The filter is written here: a view's correction is the solution of the matching's least squares,
with the inverse Hessian as covariance, and filterpy has no such update.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from scipy.spatial import cKDTree

from perception.mapping.view import View
from uav_bt.compiled import compiled
from uav_bt.lab.classes import OUTSIDE
from uav_bt.types import Pose2D
from uav_bt.types.arrays import Floats, Ids, Indices
from uav_bt.types.dead_reckoning import OdometryPose

# Standard deviation of the position's drift per axis in one second; it grows with the square root
# of time. The odometry has an error of a few centimetres in ten seconds while it follows the
# ground, and more on telemetry alone (blind).
_WALK_M: Final = 0.015
_BLIND_WALK_M: Final = 0.04
_WALK_RAD: Final = 0.008  # standard deviation of the heading's drift in one second
_MAX_YAW_STD_RAD: Final = 0.06  # upper limit of the heading's standard deviation
_POINT_STD_M: Final = 0.03  # standard deviation of a point near the camera
_RANGE_STD_RATIO: Final = 0.02  # in addition, by range: errors of height and pitch
_GATE_M: Final = 0.35  # a point further from all known points is new; chosen
# Errors of neighbouring samples, and of views 0.1 s apart, are correlated: this number of points
# counts as one. Chosen.
_ALIKE: Final = 8.0
_MARK_ALIKE: Final = 30.0  # likewise for sightings of the landing mark
_MARK_GATE_STDS: Final = 3.0  # a mark beyond these and the gate is another mark; chosen
_ROUNDS: Final = 3  # of matching
_SETTLED_M: Final = 1e-4  # a smaller step ends the rounds
_NEIGHBOURS: Final = 6  # nearest points of the map per point
_LINE_REACH_M: Final = 0.25  # distance of the neighbours that determine a line
_LINE_RATIO: Final = 8.0  # least ratio of their variances along and across a line
_MIN_POINTS: Final = 12  # matched points; with fewer a view corrects nothing
_CLASSES_APART_M: Final = 1000.0  # wider than any place
# Views contradict the map if they show only ground at more than this share of its points in view.
# Under heavy drift the share was 0.25; chosen above it.
_SHARE: Final = 0.4
_JUDGED_S: Final = 3.0  # time constant with which earlier views are forgotten; chosen
_JUDGED_POINTS: Final = 80.0  # least number of points in these views; chosen
_RESTART_S: Final = 2.0  # a map contradicted for longer is restarted; chosen
_GAP_S: Final = 0.5  # longer gaps between views do not count as contradiction; chosen


class Registration:
    """The correction from the dead-reckoned frame to the map's, and its covariance."""

    def __init__(self) -> None:
        self._state = np.zeros(3)  # x, y, yaw
        self._covariance = np.zeros((3, 3))
        self._time_s: float | None = None

    @property
    def correction(self) -> Pose2D:
        """The pose of the dead-reckoned frame in the map's."""
        return _pose(self._state)

    def corrected(self, pose: Pose2D) -> Pose2D:
        """Return a dead-reckoned pose in the map's frame."""
        return self.correction.pose_to_world(pose)

    def predict(self, reckoned: OdometryPose, *, tracked: bool) -> None:
        """Increase the uncertainty up to the time of the drone's dead-reckoned pose.

        `tracked`: whether the odometry follows the ground; otherwise it uses telemetry alone.
        """
        walk_m = _WALK_M if tracked else _BLIND_WALK_M
        if self._time_s is not None and reckoned.time_s > self._time_s:
            # The heading drifts about the drone's position.
            arm = np.array(self.correction.to_world(reckoned.x_m, reckoned.y_m)) - self._state[:2]
            about = np.array([[1.0, 0.0, arm[1]], [0.0, 1.0, -arm[0]], [0.0, 0.0, 1.0]])
            turns = self._covariance[2, 2] < _MAX_YAW_STD_RAD**2
            walk = np.diag([walk_m**2, walk_m**2, turns * _WALK_RAD**2])
            self._covariance += about @ walk @ about.T * (reckoned.time_s - self._time_s)
        self._time_s = reckoned.time_s

    def match(self, view: View, known_m: Floats, known_ids: Ids) -> float | None:
        """Correct by the points of a dead-reckoned view that are on the map.

        Args:
            view: the view, with its dead-reckoned pose.
            known_m: (M, 2) points of the map.
            known_ids: (M,) their classes.

        Returns:
            The median distance of the view's points from the map's, across lines; None with too
            few matched points.
        """
        local_m = np.vstack([view.bases.xy_m, view.edges_m])
        if min(len(local_m), len(known_m)) < _MIN_POINTS:
            return None
        seen_m = view.pose.points_to_world(view.body_m(local_m))
        ids = np.concatenate([view.bases.ids, np.full(len(view.edges_m), OUTSIDE, dtype=np.uint8)])
        tree = cKDTree(_apart(known_m, known_ids))
        std_m = np.hypot(_POINT_STD_M, _RANGE_STD_RATIO * np.hypot(*local_m.T))
        prior = np.linalg.inv(self._covariance + 1e-8 * np.eye(3))
        state, hessian = self._state.copy(), prior

        def equations() -> tuple[Floats, Floats, Floats]:
            places_m = _pose(state).points_to_world(seen_m)
            distances_m, indices = tree.query(
                _apart(places_m, ids),
                k=min(_NEIGHBOURS, len(known_m)),
                # Points beyond have no weight, and their lines do not matter.
                distance_upper_bound=_GATE_M + _LINE_REACH_M,
            )
            return _equations(places_m, state[:2], std_m, distances_m, indices, known_m)

        for _ in range(_ROUNDS):
            residual_m, seen_hessian, seen_gradient = equations()
            if len(residual_m) < _MIN_POINTS:
                return None
            hessian = prior + seen_hessian / _ALIKE
            gradient = seen_gradient / _ALIKE + prior @ (state - self._state)
            step = np.linalg.solve(hessian, gradient)
            state = state - step
            if np.abs(step).max() < _SETTLED_M:
                break
        self._state, self._covariance = state, np.linalg.inv(hessian)
        residual_m, _, _ = equations()
        return float(np.median(np.abs(residual_m))) if len(residual_m) else None

    def correct_by_mark(self, seen_m: Floats, known_m: Floats, std_m: float) -> bool:
        """Correct by the landing mark; False if the difference is too large for drift.

        Args:
            seen_m: (2,) seen position, in the dead-reckoned frame.
            known_m: (2,) position in the map.
            std_m: standard deviation of their difference.
        """
        place = np.array(self.correction.to_world(*map(float, seen_m)))
        residual_m, arm = place - known_m, place - self._state[:2]
        if math.hypot(*residual_m) > max(_GATE_M, _MARK_GATE_STDS * std_m):
            return False
        slopes = np.array([[1.0, 0.0, -arm[1]], [0.0, 1.0, arm[0]]])
        noise = np.eye(2) * std_m**2 * _MARK_ALIKE
        gain = self._covariance @ slopes.T
        gain = gain @ np.linalg.inv(slopes @ gain + noise)
        self._state = self._state - gain @ residual_m
        self._covariance = (np.eye(3) - gain @ slopes) @ self._covariance
        return True


class Contradiction:
    """Detection of views that contradict the map, because the drone's pose on it is wrong."""

    def __init__(self, agreed_s: float) -> None:
        self._agreed_s = agreed_s  # time of the last view that agreed; -inf before any
        self._judged_s = -math.inf
        self._points = np.zeros(2)  # points of the map in views, and those that showed ground

    def add(self, time_s: float, in_view: int, free: int) -> None:
        """Add the number of the map's points in a view, and of those at which it shows ground."""
        unseen_s = time_s - self._judged_s
        self._points = self._points * math.exp(-unseen_s / _JUDGED_S) + (in_view, free)
        self._judged_s = time_s
        if _GAP_S < unseen_s < math.inf:
            self._agreed_s += unseen_s
        in_all, gone = self._points
        if in_all < _JUDGED_POINTS or gone <= _SHARE * in_all:
            self._agreed_s = time_s

    def lasts_s(self, time_s: float) -> float:
        """Return the time for which views have contradicted the map, s."""
        return max(0.0, time_s - self._agreed_s) if self._agreed_s > -math.inf else 0.0

    def is_certain(self, time_s: float) -> bool:
        """Return whether the map must be restarted."""
        return self.lasts_s(time_s) > _RESTART_S


def _pose(state: Floats) -> Pose2D:
    x_m, y_m, yaw_rad = map(float, state)
    return Pose2D(x_m=x_m, y_m=y_m, yaw_rad=yaw_rad)


def _apart(places_m: Floats, ids: Ids) -> Floats:
    """Return (N, 3) places with the class as third axis, so that classes are far apart."""
    return np.column_stack([places_m, _CLASSES_APART_M * ids])


@compiled(
    "Tuple((float64[::1], float64[:, ::1], float64[::1]))(float64[:, ::1], float64[::1],"
    " float64[::1], float64[:, ::1], intp[:, ::1], float64[:, ::1])"
)
def _equations(  # noqa: PLR0917 - Numba passes arguments by position
    places_m: Floats,
    origin_m: Floats,
    std_m: Floats,
    distances_m: Floats,
    indices: Indices,
    known_m: Floats,
) -> tuple[Floats, Floats, Floats]:
    """Set up the least squares of one round of matching.

    The residual of a place is its distance from the map along a normal: across the line of its
    neighbours, or towards the nearest neighbour where they form no line.

    Args:
        places_m: (N, 2) points of the view in the map's frame.
        origin_m: (2,) origin of the dead-reckoned frame, about which the correction turns.
        std_m: (N,) standard deviations.
        distances_m: (N, K) distances of the nearest known points, the nearest first.
        indices: (N, K) rows of these points; any value where the distance is infinite.
        known_m: (M, 2) known points.

    Returns:
        (R,) residuals of the places near enough to known points; the Hessian (3, 3) and the
        gradient (3,) of their weighted squares by x, y and yaw.
    """
    residuals_m = np.empty(len(places_m))
    hessian, gradient = np.zeros((3, 3)), np.zeros(3)
    slope = np.empty(3)
    count = 0
    for place in range(len(places_m)):
        nearest_m = distances_m[place, 0]
        if not nearest_m <= _GATE_M:
            continue
        x_m, y_m = places_m[place, 0], places_m[place, 1]
        number, middle_x, middle_y = 0, 0.0, 0.0
        while number < indices.shape[1] and distances_m[place, number] <= nearest_m + _LINE_REACH_M:
            middle_x += known_m[indices[place, number], 0]
            middle_y += known_m[indices[place, number], 1]
            number += 1
        middle_x, middle_y = middle_x / number, middle_y / number
        xx, xy, yy = 0.0, 0.0, 0.0
        for neighbour in range(number):
            dx = known_m[indices[place, neighbour], 0] - middle_x
            dy = known_m[indices[place, neighbour], 1] - middle_y
            xx, xy, yy = xx + dx * dx, xy + dx * dy, yy + dy * dy
        # Eigenvalues of the symmetric 2x2 matrix of the spread; the normal has the smaller one.
        half, root = 0.5 * (xx + yy), math.hypot(0.5 * (xx - yy), xy)
        if half + root > _LINE_RATIO * max(half - root, 1e-9):
            angle = 0.5 * math.atan2(2.0 * xy, xx - yy)  # of the line
            normal_x, normal_y = -math.sin(angle), math.cos(angle)
            residual_m = (x_m - middle_x) * normal_x + (y_m - middle_y) * normal_y
        else:
            off_x = x_m - known_m[indices[place, 0], 0]
            off_y = y_m - known_m[indices[place, 0], 1]
            normal_x, normal_y = off_x / max(nearest_m, 1e-9), off_y / max(nearest_m, 1e-9)
            residual_m = off_x * normal_x + off_y * normal_y
        residuals_m[count] = residual_m
        count += 1
        slope[0], slope[1] = normal_x, normal_y
        slope[2] = normal_y * (x_m - origin_m[0]) - normal_x * (y_m - origin_m[1])
        weight = 1.0 / (1.0 + (residual_m / std_m[place]) ** 2) / std_m[place] ** 2
        for row in range(3):
            gradient[row] += weight * slope[row] * residual_m
            for column in range(3):
                hessian[row, column] += weight * slope[row] * slope[column]
    return residuals_m[:count], hessian, gradient
