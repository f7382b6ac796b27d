"""Correct the drone's place by what it sees again: scan matching against the map's points.

The transform from the dead-reckoned frame to the map's (REP 105's `odom` to `map`) is the state of
a Kalman filter. It grows uncertain with the odometry's drift. Each view is matched to the map by
iterated closest points of the same class (Besl and McKay, 1992), point to line where the neighbours
in the map form one (Chen and Medioni, 1992), with Cauchy weights, and held to the prediction by its
covariance, so that an edge seen alone corrects across it only.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from uav_bt.types import Pose2D

Floats = NDArray[np.float64]
_CLASSES_APART_M: Final = 1000.0  # more than any place is wide


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
    gate_m: float = 0.35  # what is further from all known points is new
    # Neighbouring samples, and views a tenth of a second apart, err alike: so many count as one.
    alike: float = 8.0
    mark_alike: float = 30.0  # of sightings of the landing mark
    mark_gate_stds: float = 3.0  # a mark is another beyond so many, and beyond gate_m
    rounds: int = 3
    settled_m: float = 1e-4  # a smaller step ends the rounds
    neighbours: int = 6
    line_reach_m: float = 0.25  # of the neighbours that show a line's direction
    line_ratio: float = 8.0  # of their variances along and across
    min_points: int = 12  # matched; fewer say nothing


class Points(NamedTuple):
    """Points on the ground, and what stands there."""

    xy_m: Floats  # (N, 2)
    ids: NDArray[np.uint8]  # (N,) classes

    def apart(self) -> Floats:
        """Return (N, 3) places in which points of different classes are far from each other."""
        return np.column_stack([self.xy_m, _CLASSES_APART_M * self.ids])


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

    def match(self, seen: Points, ranges_m: Floats, known: Points) -> float | None:
        """Correct by points of a view that stand in the map.

        Args:
            seen: points of a view, N of them, in the dead-reckoned frame.
            ranges_m: (N,) their distances from the camera.
            known: points of the map.

        Returns:
            The median distance of the view's points from where they stand in the map, across
            lines; None when there are too few of them to say.
        """
        cfg = self._config
        if min(len(seen.ids), len(known.ids)) < cfg.min_points:
            return None
        tree = cKDTree(known.apart())
        std_m = np.hypot(cfg.point_std_m, cfg.range_std_ratio * ranges_m)
        prior = np.linalg.inv(self._covariance + 1e-8 * np.eye(3))
        state, hessian = self._state.copy(), prior
        for _ in range(cfg.rounds):
            places = seen._replace(xy_m=_pose(state).points_to_world(seen.xy_m))
            residual_m, normals, distance_m = _equations(places, tree, known.xy_m, cfg)
            near = distance_m <= cfg.gate_m
            if np.count_nonzero(near) < cfg.min_points:
                return None
            slopes = np.column_stack([normals, _turning(normals, places.xy_m - state[:2])])
            weight = near / (1.0 + (residual_m / std_m) ** 2) / std_m**2 / cfg.alike
            hessian = prior + slopes.T @ (weight[:, None] * slopes)
            gradient = slopes.T @ (weight * residual_m) + prior @ (state - self._state)
            step = np.linalg.solve(hessian, gradient)
            state = state - step
            if np.abs(step).max() < cfg.settled_m:
                break
        self._state, self._covariance = state, np.linalg.inv(hessian)
        places = seen._replace(xy_m=_pose(state).points_to_world(seen.xy_m))
        residual_m, _, distance_m = _equations(places, tree, known.xy_m, cfg)
        near = distance_m <= cfg.gate_m
        return float(np.median(np.abs(residual_m[near]))) if near.any() else None

    def see_mark(self, seen_m: Floats, known_m: Floats, std_m: float) -> bool:
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


def _equations(
    places: Points, tree: cKDTree, known: Floats, cfg: RegistrationConfig
) -> tuple[Floats, Floats, Floats]:
    """Return for each place how far it is from the map, (N,), along which normal, (N, 2).

    And its distance to the nearest known point of its class, (N,).
    """
    distances, indices = tree.query(places.apart(), k=min(cfg.neighbours, len(known)))
    around = known[indices]
    counted = (distances <= distances[:, :1] + cfg.line_reach_m)[..., None]
    number = counted.sum(axis=1)
    centre = (around * counted).sum(axis=1) / number
    spread = (around - centre[:, None, :]) * counted
    values, vectors = np.linalg.eigh(np.einsum("nki,nkj->nij", spread, spread))
    is_line = (values[:, 1] > cfg.line_ratio * np.maximum(values[:, 0], 1e-9))[:, None]
    apart = places.xy_m - around[:, 0]
    towards = apart / np.maximum(distances[:, :1], 1e-9)
    normals = np.where(is_line, vectors[:, :, 0], towards)
    offset = np.where(is_line, places.xy_m - centre, apart)
    return np.einsum("ni,ni->n", offset, normals), normals, distances[:, 0]
