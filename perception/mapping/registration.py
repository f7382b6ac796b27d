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
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from perception.mapping.view import View
from uav_bt.compiled import compiled
from uav_bt.lab.classes import OUTSIDE
from uav_bt.types import Pose2D
from uav_bt.types.arrays import Floats, Indices

_CLASSES_APART_M: Final = 1000.0  # wider than any place


@dataclass(frozen=True, kw_only=True)
class RegistrationConfig:
    """Drift of dead reckoning, and errors of views."""

    # Standard deviation of the position's drift per axis in one second; it grows with the square
    # root of time. The odometry has an error of a few centimetres in ten seconds while it follows
    # the ground, and more on telemetry alone (`blind_walk_m`).
    walk_m: float = 0.015
    blind_walk_m: float = 0.04
    walk_rad: float = 0.008  # standard deviation of the heading's drift in one second
    max_yaw_std_rad: float = 0.06  # upper limit of the heading's standard deviation
    point_std_m: float = 0.03  # standard deviation of a point near the camera
    range_std_ratio: float = 0.02  # in addition, by range: errors of height and pitch
    gate_m: float = 0.35  # a point further from all known points is new; chosen
    # Errors of neighbouring samples, and of views 0.1 s apart, are correlated: this number of
    # points counts as one. Chosen.
    alike: float = 8.0
    mark_alike: float = 30.0  # likewise for sightings of the landing mark
    mark_gate_stds: float = 3.0  # a mark beyond these and `gate_m` is another mark; chosen
    rounds: int = 3  # of matching
    settled_m: float = 1e-4  # a smaller step ends the rounds
    neighbours: int = 6  # nearest points of the map per point
    line_reach_m: float = 0.25  # distance of the neighbours that determine a line
    line_ratio: float = 8.0  # least ratio of their variances along and across a line
    min_points: int = 12  # matched points; with fewer a view corrects nothing


class Registration:
    """The correction from the dead-reckoned frame to the map's, and its covariance."""

    def __init__(self, config: RegistrationConfig | None = None) -> None:
        self._config = config or RegistrationConfig()
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

    def predict(self, reckoned: Pose2D, time_s: float, *, tracked: bool) -> None:
        """Increase the uncertainty up to a time.

        Args:
            reckoned: the drone's dead-reckoned pose; the heading drifts about its position.
            time_s: time of that pose.
            tracked: whether the odometry follows the ground; otherwise it uses telemetry alone.
        """
        cfg = self._config
        walk_m = cfg.walk_m if tracked else cfg.blind_walk_m
        if self._time_s is not None and time_s > self._time_s:
            arm = np.array(self.correction.to_world(reckoned.x_m, reckoned.y_m)) - self._state[:2]
            about = np.array([[1.0, 0.0, arm[1]], [0.0, 1.0, -arm[0]], [0.0, 0.0, 1.0]])
            turns = self._covariance[2, 2] < cfg.max_yaw_std_rad**2
            walk = np.diag([walk_m**2, walk_m**2, turns * cfg.walk_rad**2])
            self._covariance += about @ walk @ about.T * (time_s - self._time_s)
        self._time_s = time_s

    def match(self, view: View, known_m: Floats, known_ids: NDArray[np.uint8]) -> float | None:
        """Correct by the points of a view that are on the map.

        Args:
            view: the view, with its dead-reckoned pose.
            known_m: (M, 2) points of the map.
            known_ids: (M,) their classes.

        Returns:
            The median distance of the view's points from the map's, across lines; None with too
            few matched points.
        """
        cfg, local_m = self._config, np.vstack([view.bases_m, view.edges_m])
        if min(len(local_m), len(known_m)) < cfg.min_points:
            return None
        seen_m = view.pose.points_to_world(view.body_m(local_m))
        edge_ids = np.full(len(view.edges_m), OUTSIDE, dtype=np.uint8)
        ids = np.concatenate([view.base_ids, edge_ids])
        tree = cKDTree(_apart(known_m, known_ids))
        std_m = np.hypot(cfg.point_std_m, cfg.range_std_ratio * np.hypot(*local_m.T))
        prior = np.linalg.inv(self._covariance + 1e-8 * np.eye(3))
        state, hessian = self._state.copy(), prior

        def equations() -> tuple[Floats, Floats, Floats]:
            places_m = _pose(state).points_to_world(seen_m)
            distances_m, indices = tree.query(
                _apart(places_m, ids),
                k=min(cfg.neighbours, len(known_m)),
                # Points beyond have no weight, and their lines do not matter.
                distance_upper_bound=cfg.gate_m + cfg.line_reach_m,
            )
            limits = cfg.gate_m, cfg.line_reach_m, cfg.line_ratio
            return _equations(places_m, state[:2], std_m, distances_m, indices, known_m, limits)

        for _ in range(cfg.rounds):
            residual_m, seen_hessian, seen_gradient = equations()
            if len(residual_m) < cfg.min_points:
                return None
            hessian = prior + seen_hessian / cfg.alike
            gradient = seen_gradient / cfg.alike + prior @ (state - self._state)
            step = np.linalg.solve(hessian, gradient)
            state = state - step
            if np.abs(step).max() < cfg.settled_m:
                break
        self._state, self._covariance = state, np.linalg.inv(hessian)
        residual_m, _, _ = equations()
        return float(np.median(np.abs(residual_m))) if len(residual_m) else None

    def correct_by_mark(self, seen_m: Floats, known_m: Floats, std_m: float) -> bool:
        """Correct by the landing mark, whose place in the map is known.

        Args:
            seen_m: (2,) seen position, in the dead-reckoned frame.
            known_m: (2,) position in the map.
            std_m: standard deviation of their difference.

        Returns:
            False if the difference is too large for the drone's drift.
        """
        cfg = self._config
        place = np.array(self.correction.to_world(*map(float, seen_m)))
        residual_m, arm = place - known_m, place - self._state[:2]
        if math.hypot(*residual_m) > max(cfg.gate_m, cfg.mark_gate_stds * std_m):
            return False
        slopes = np.array([[1.0, 0.0, -arm[1]], [0.0, 1.0, arm[0]]])
        noise = np.eye(2) * std_m**2 * cfg.mark_alike
        gain = self._covariance @ slopes.T
        gain = gain @ np.linalg.inv(slopes @ gain + noise)
        self._state = self._state - gain @ residual_m
        self._covariance = (np.eye(3) - gain @ slopes) @ self._covariance
        return True


def _pose(state: Floats) -> Pose2D:
    x_m, y_m, yaw_rad = map(float, state)
    return Pose2D(x_m=x_m, y_m=y_m, yaw_rad=yaw_rad)


def _apart(places_m: Floats, ids: NDArray[np.uint8]) -> Floats:
    """Return (N, 3) places with the class as third axis, so that classes are far apart."""
    return np.column_stack([places_m, _CLASSES_APART_M * ids])


@compiled(
    "Tuple((float64[::1], float64[:, ::1], float64[::1]))"
    "(float64[:, ::1], float64[::1], float64[::1], float64[:, ::1], intp[:, ::1], float64[:, ::1],"
    " UniTuple(float64, 3))"
)
def _equations(  # noqa: PLR0917 - Numba passes arguments by position
    places_m: Floats,
    origin_m: Floats,
    std_m: Floats,
    distances_m: Floats,
    indices: Indices,
    known_m: Floats,
    limits: tuple[float, float, float],
) -> tuple[Floats, Floats, Floats]:
    """Set up the least squares of one round of matching.

    The residual of a place is its distance from the map along a normal: across the line of its
    neighbours, or towards the nearest neighbour where they form no line.

    Args:
        places_m: (N, 2) points of the view in the map's frame.
        origin_m: (2,) origin of the dead-reckoned frame, about which the correction turns.
        std_m: (N,) standard deviation of each point.
        distances_m: (N, K) distances of the nearest known points, the nearest first.
        indices: (N, K) rows of these points; any value where the distance is infinite.
        known_m: (M, 2) known points.
        limits: distance of a place from its nearest known point at most, m; distance of the
            neighbours beyond it that determine a line, m; least ratio of variances along and
            across a line.

    Returns:
        (R,) residuals of the places near enough to known points; the Hessian (3, 3) and the
        gradient (3,) of their weighted squares by x, y and yaw.
    """
    gate_m, line_reach_m, line_ratio = limits
    residuals_m = np.empty(len(places_m))
    hessian, gradient = np.zeros((3, 3)), np.zeros(3)
    slope = np.empty(3)
    count = 0
    for place in range(len(places_m)):
        nearest_m = distances_m[place, 0]
        if not nearest_m <= gate_m:
            continue
        x_m, y_m = places_m[place, 0], places_m[place, 1]
        number, middle_x, middle_y = 0, 0.0, 0.0
        while number < indices.shape[1] and distances_m[place, number] <= nearest_m + line_reach_m:
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
        if half + root > line_ratio * max(half - root, 1e-9):
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
