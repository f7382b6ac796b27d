"""Correct the drone's place by points that are seen again: scan matching against the map's points.

The transform from the dead-reckoned frame to the map's (REP 105's `odom` to `map`) is the state of
a Kalman filter. It grows uncertain with the odometry's drift. Each view is matched to the map by
iterated closest points of the same class (Besl and McKay, 1992), point to line where the neighbours
in the map form one (Chen and Medioni, 1992), with Cauchy weights, and held to the prediction by its
covariance, so that an edge seen alone corrects across it only.

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
    """How fast dead reckoning drifts, and how far views are trusted."""

    # Of the place, each axis, in a second; it grows with the square root of time. The odometry errs
    # by a few centimetres in ten seconds while it follows the ground, by more on telemetry alone.
    walk_m: float = 0.015
    blind_walk_m: float = 0.04
    walk_rad: float = 0.008  # of the heading, likewise
    max_yaw_std_rad: float = 0.06  # telemetry's heading is not wrong by more
    point_std_m: float = 0.03  # of a point near by
    range_std_ratio: float = 0.02  # of its range besides: height and pitch are off a little
    gate_m: float = 0.35  # a point further from all known points is new; chosen
    # Neighbouring samples, and views 0.1 s apart, err alike: this number counts as one. Chosen.
    alike: float = 8.0
    mark_alike: float = 30.0  # of sightings of the landing mark
    mark_gate_stds: float = 3.0  # beyond these and `gate_m` a mark is another; chosen
    rounds: int = 3
    settled_m: float = 1e-4  # a smaller step ends the rounds
    neighbours: int = 6
    line_reach_m: float = 0.25  # of the neighbours that show a line's direction
    line_ratio: float = 8.0  # of their variances along and across
    min_points: int = 12  # matched; fewer say nothing


class Registration:
    """The correction from the dead-reckoned frame to the map's, and how sure it is."""

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
        """Let the uncertainty grow up to a time.

        Args:
            reckoned: the drone's dead-reckoned pose, about which its heading drifts.
            time_s: of that pose.
            tracked: whether the odometry follows the ground; otherwise telemetry alone.
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
        """Correct by the points of a view that stand on the map.

        Args:
            view: its pose is dead-reckoned.
            known: points of the map.

        Returns:
            The median distance of the view's points from where they stand on the map, across
            lines; None when there are too few of them.
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
            seen_m: (2,) where it appears, in the dead-reckoned frame.
            known_m: (2,) where it is in the map.
            std_m: of the two together.

        Returns:
            False when it appears too far from there to be the drone's drift.
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
    """Return how far points move along their normals for a radian about the frame's origin."""
    return np.asarray(normals[:, 1] * arms[:, 0] - normals[:, 0] * arms[:, 1])


def _apart(places_m: Floats, ids: NDArray[np.uint8]) -> Floats:
    """Return (N, 3) places in which points of different classes are far from each other."""
    return np.column_stack([places_m, _CLASSES_APART_M * ids])


def _equations(
    places_m: Floats,
    ids: NDArray[np.uint8],
    tree: cKDTree,
    known_m: Floats,
    cfg: RegistrationConfig,
) -> tuple[Floats, Floats, Floats]:
    """Return for each place how far it is from the map, (N,), along which normal, (N, 2).

    And its distance to the nearest known point of its class, (N,).
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
