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

from perception.mapping.landmarks import Landmarks
from perception.mapping.view import View
from uav_bt.classes import BACKGROUND
from uav_bt.types import Pose2D
from uav_bt.types.arrays import Floats

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

    def match(self, view: View, known: Landmarks) -> float | None:
        """Correct by the points of a view that are on the map.

        Args:
            view: the view, with its dead-reckoned pose.
            known: points of the map.

        Returns:
            The median distance of the view's points from the map's, across lines; None with too
            few matched points.
        """
        cfg, local_m = self._config, np.vstack([view.bases_m, view.edges_m])
        if min(len(local_m), len(known)) < cfg.min_points:
            return None
        seen_m = view.pose.points_to_world(view.body_m(local_m))
        edge_ids = np.full(len(view.edges_m), BACKGROUND, dtype=np.uint8)
        ids = np.concatenate([view.base_ids, edge_ids])
        tree = cKDTree(_apart(known.xy_m, known.ids))
        std_m = np.hypot(cfg.point_std_m, cfg.range_std_ratio * np.hypot(*local_m.T))
        prior = np.linalg.inv(self._covariance + 1e-8 * np.eye(3))
        state, hessian = self._state.copy(), prior
        for _ in range(cfg.rounds):
            places_m = _pose(state).points_to_world(seen_m)
            residual_m, normals, distance_m = _equations(places_m, ids, tree, known.xy_m, cfg)
            near = distance_m <= cfg.gate_m
            if np.count_nonzero(near) < cfg.min_points:
                return None
            slopes = np.column_stack([normals, _turning(normals, places_m - state[:2])])
            weight = near / (1.0 + (residual_m / std_m) ** 2) / std_m**2 / cfg.alike
            hessian = prior + slopes.T @ (weight[:, None] * slopes)
            gradient = slopes.T @ (weight * residual_m) + prior @ (state - self._state)
            step = np.linalg.solve(hessian, gradient)
            state = state - step
            if np.abs(step).max() < cfg.settled_m:
                break
        self._state, self._covariance = state, np.linalg.inv(hessian)
        places_m = _pose(state).points_to_world(seen_m)
        residual_m, _, distance_m = _equations(places_m, ids, tree, known.xy_m, cfg)
        near = distance_m <= cfg.gate_m
        return float(np.median(np.abs(residual_m[near]))) if near.any() else None

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


def _turning(normals: Floats, arms: Floats) -> Floats:
    """Return the movement of points along their normals per radian about the frame's origin."""
    return np.asarray(normals[:, 1] * arms[:, 0] - normals[:, 0] * arms[:, 1])


def _apart(places_m: Floats, ids: NDArray[np.uint8]) -> Floats:
    """Return (N, 3) places with the class as third axis, so that classes are far apart."""
    return np.column_stack([places_m, _CLASSES_APART_M * ids])


def _equations(
    places_m: Floats,
    ids: NDArray[np.uint8],
    tree: cKDTree,
    known_m: Floats,
    cfg: RegistrationConfig,
) -> tuple[Floats, Floats, Floats]:
    """Return each place's residual, (N,), its normal, (N, 2), and its distance, (N,).

    The residual is the distance from the map along the normal. The third value is the distance to
    the nearest known point of the same class.
    """
    distances, indices = tree.query(_apart(places_m, ids), k=min(cfg.neighbours, len(known_m)))
    around = known_m[indices]
    counted = (distances <= distances[:, :1] + cfg.line_reach_m)[..., None]
    number = counted.sum(axis=1)
    centre = (around * counted).sum(axis=1) / number
    spread = (around - centre[:, None, :]) * counted
    values, vectors = np.linalg.eigh(np.einsum("nki,nkj->nij", spread, spread))
    is_line = (values[:, 1] > cfg.line_ratio * np.maximum(values[:, 0], 1e-9))[:, None]
    apart_m = places_m - around[:, 0]
    towards = apart_m / np.maximum(distances[:, :1], 1e-9)
    normals = np.where(is_line, vectors[:, :, 0], towards)
    offset = np.where(is_line, places_m - centre, apart_m)
    return np.einsum("ni,ni->n", offset, normals), normals, distances[:, 0]
