"""The mark's fix, obstacles near the drone, and the held turn."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from uav_bt.errors import ShapeError
from uav_bt.settings import brief_repr


@dataclass(frozen=True, kw_only=True)
class MarkFix:
    """Position of the landing mark, from the body's centre in the heading-aligned level plane."""

    captured_s: float  # capture time of the last frame in which the mark was detected
    forward_m: float  # distance ahead
    right_m: float  # distance to the right
    height_m: float  # height of the mark's top above the ground
    detected: bool  # true if the newest frame shows the mark, False if the tracker predicts it
    confidence: float = 1.0  # 0 to 1, of the last detection
    std_m: float = 0.0  # standard deviation of the position
    # Heading of the drone relative to the mark, clockwise, -180 to 180; 0 if the drone looks
    # towards the mark's upper edge. None if the mark does not show it.
    heading_deg: float | None = None

    @property
    def range_m(self) -> float:
        """Horizontal distance from the body's centre to the mark's centre."""
        return math.hypot(self.forward_m, self.right_m)

    @property
    def bearing_rad(self) -> float:
        """Direction of the mark, clockwise positive from the heading."""
        return math.atan2(self.right_m, self.forward_m)


# A path past a point beside the drone may come nearer to it by this distance; chosen.
_PASSING_M = 0.02


@dataclass(frozen=True, kw_only=True, eq=False)
class NearObstacles:
    """Obstacles and edges near the drone, from the body's centre, placed by dead reckoning."""

    # (N, 2): forward, right, in the heading-aligned level frame
    points_m: NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 2)))
    captured_s: float = -math.inf  # of the newest frame used
    # (K, 2), in the same frame: assumed places of obstacles of unknown range.
    assumed_m: NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 2)))
    # (E, 2), in the same frame: points of the ground's edge.
    edges_m: NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 2)))
    # (M,) Bearings of obstacles whose base was never seen, nearer than the nearest visible ground:
    # from the heading, clockwise positive, one per degree.
    unplaced_rad: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))
    # (N,) and (E,) Time since the last sighting of points and edges; empty: unknown.
    points_age_s: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))
    edges_age_s: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        for points in (self.points_m, self.assumed_m, self.edges_m):
            if points.ndim != 2 or points.shape[1] != 2:
                raise ShapeError("obstacle points", expected="Nx2", actual=points.shape)

    @property
    def nearest_m(self) -> float:
        """Distance from the body's centre to the nearest point, inf without points."""
        if not len(self.points_m):
            return math.inf
        return float(np.hypot(self.points_m[:, 0], self.points_m[:, 1]).min())

    def within(self, reach_m: float) -> NearObstacles:
        """Return only the points and edges within a distance of the body's centre."""
        points, edges = (np.hypot(*each.T) <= reach_m for each in (self.points_m, self.edges_m))
        return replace(
            self,
            points_m=self.points_m[points],
            edges_m=self.edges_m[edges],
            points_age_s=self.points_age_s[points] if len(self.points_age_s) else np.empty(0),
            edges_age_s=self.edges_age_s[edges] if len(self.edges_age_s) else np.empty(0),
        )

    def allows(
        self, forward_m: float, right_m: float = 0.0, *, margin_m: float, assumed: bool = True
    ) -> bool:
        """Return whether a straight path keeps a margin from every point, assumed ones included.

        A point nearer than the margin may be passed and left, but not approached.
        """
        length_m = math.hypot(forward_m, right_m)
        points = np.vstack([self.points_m, self.assumed_m]) if assumed else self.points_m
        if not len(points) or length_m == 0.0:
            return True
        along = np.clip(points @ (forward_m / length_m, right_m / length_m), 0.0, length_m)
        path = along[:, None] * (forward_m / length_m, right_m / length_m)
        then_m = np.linalg.norm(points - path, axis=1)
        now_m = np.linalg.norm(points, axis=1)
        return bool(np.all((then_m >= margin_m) | (then_m >= now_m - _PASSING_M)))

    def unplaced_within(self, half_angle_rad: float) -> int:
        """Return the number of bearings within an angle that show an obstacle of unknown range."""
        return int(np.count_nonzero(np.abs(self.unplaced_rad) < half_angle_rad))


@dataclass(frozen=True, kw_only=True)
class HeldTurn:
    """A turn on the spot that is held in one direction until the drone advances again."""

    direction: int = 0  # +1 clockwise, -1 counter-clockwise, 0 none
    turned_rad: float = 0.0  # since the last advance, both ways added up
    relief_turns: int = 0  # failed detours; the policy decides as after this number of full turns

    @property
    def full_turns(self) -> int:
        """Number of full turns without a free path, plus `relief_turns`."""
        return self.relief_turns + int(self.turned_rad / (2.0 * math.pi))


# Least height of a camera above a surface, metres; projections raise lower ones to it: with noise
# that of a standing drone can be zero or less. Chosen: half of the body's height.
MIN_VIEW_HEIGHT_M: Final = 0.05
