"""The map of the place that a mission keeps: ground, obstacles, edges, objects, landing mark."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from uav_bt.brief import shapes_repr
from uav_bt.errors import ShapeError
from uav_bt.types.arrays import Flags, Floats
from uav_bt.types.pose import Pose2D
from uav_bt.types.surroundings import NearObstacles

EDGE_MARGIN_M: Final = 0.3  # a place beyond the edge by more is surely beyond it; chosen


@dataclass(frozen=True, kw_only=True)
class MapObject:
    """An object that stands in the place, as far as its base was seen."""

    class_id: int
    x_m: float  # the middle of its base, in the map's frame
    y_m: float
    size_m: float  # of the longer side of its base, as far as seen
    std_m: float  # one standard deviation of the position
    seen_s: float  # the capture of the newest frame that showed its base
    width_m: float = 0.0  # of the shorter side
    yaw_rad: float = 0.0  # of the longer side, from the map's x towards its y

    def corners_m(self, *, margin_m: float = 0.0) -> Floats:
        """Return the corners of its base and a margin around, (4, 2) in the map's frame."""
        middle = Pose2D(x_m=self.x_m, y_m=self.y_m, yaw_rad=self.yaw_rad)
        return np.array(middle.rectangle(self.size_m / 2 + margin_m, self.width_m / 2 + margin_m))

    def outline_m(self, step_m: float) -> Floats:
        """Return points on the sides of its base, (N, 2) in the map's frame.

        Args:
            step_m: Largest distance between two points.
        """
        corners_m = self.corners_m()
        count = max(1, math.ceil(max(self.size_m, self.width_m) / step_m))
        shares = np.arange(count)[:, None] / count
        sides = zip(corners_m, np.roll(corners_m, -1, axis=0), strict=True)
        return np.vstack([begin + shares * (end - begin) for begin, end in sides])


@dataclass(frozen=True, kw_only=True)
class MapMark:
    """The landing mark in the map."""

    x_m: float
    y_m: float
    std_m: float
    seen_s: float
    moved_m: float = 0.0  # found elsewhere than the map had it: how far, all times together


@dataclass(frozen=True, kw_only=True)
class MapMover:
    """Something that moves: where it is at the time of the map's pose, and how it goes on."""

    id: int  # counts up in a mission
    x_m: float  # its middle, in the map's frame
    y_m: float
    x_mps: float  # its velocity, in the map's frame
    y_mps: float
    std_m: float  # one standard deviation of the position, the larger axis
    std_mps: float  # likewise of the velocity
    radius_m: float  # of a circle around its base
    first_s: float  # the captures of the frames that showed it first and last
    seen_s: float

    @property
    def speed_mps(self) -> float:
        """How fast it moves."""
        return math.hypot(self.x_mps, self.y_mps)

    def at(self, ahead_s: float | Floats) -> Floats:
        """Return where it will be when it goes on like that, (..., 2) in the map's frame.

        Args:
            ahead_s: seconds from the map's pose on, of any shape.
        """
        later = np.asarray(ahead_s, dtype=float)[..., None]
        return np.asarray((self.x_m, self.y_m) + later * (self.x_mps, self.y_mps))


@dataclass(frozen=True, kw_only=True, eq=False)
class SiteMapBase:
    """Everything of a site map but its grids: a record keeps it as it is.

    Attributes:
        pose: of the drone, now.
        corner_m: the centre of the grids' cell (0, 0).
        cell_m: side of a cell.
        obstacles_m: (N, 2) points where obstacles stand.
        edges_m: (K, 2) points where the ground ends.
        captured_s: capture of the newest view.
        movers: what moves, where it is now. None of it is among the obstacles.
        lanes_m: (L, 2) places where something moved lately, and that no view has shown since.
        objects: obstacles with class, place and size.
        mark: the landing mark; None before it was seen.
        correction: the pose of the dead-reckoned frame in the map's frame.
        residual_m: mean distance of views' points from where they stand on the map.
        contradicted_s: for how long views have contradicted the map.
        restarts: how often the map was begun anew for that.
        full: whether part of the place lies beyond the grid.
        untracked_s: for how long the odometry has followed no ground.
    """

    pose: Pose2D
    corner_m: tuple[float, float]
    cell_m: float
    obstacles_m: Floats
    edges_m: Floats
    captured_s: float
    movers: tuple[MapMover, ...] = ()
    lanes_m: Floats = field(default_factory=lambda: np.empty((0, 2)))
    objects: tuple[MapObject, ...] = ()
    mark: MapMark | None = None
    correction: Pose2D = field(default_factory=lambda: Pose2D(x_m=0.0, y_m=0.0, yaw_rad=0.0))
    residual_m: float = 0.0
    contradicted_s: float = 0.0
    restarts: int = 0
    full: bool = False
    untracked_s: float = 0.0


@dataclass(frozen=True, kw_only=True, eq=False)
class SiteMap(SiteMapBase):
    """Grids around the take-off point, obstacles in them, and obstacles near the drone.

    The frame is the dead-reckoned one: x along yaw 0, y to its right, the origin where the mission
    began; views have corrected the drone's place in it. All grids have one shape, rows along x and
    columns along y.

    Attributes:
        seen_s: (R, C) float64 when the cell last showed ground; -inf: never.
        free: (R, C) cells known to be free to fly: ground, or below a line of sight to the ground.
        outside: (R, C) cells beyond the edge of the ground.
        passed: (R, C) cells within half a metre of the flown path.
        near: obstacles and edges near the drone, from `pose`, placed by dead reckoning: also those
            that a few views have seen, and those of unknown range.
    """

    seen_s: Floats
    free: Flags
    outside: Flags
    passed: Flags
    near: NearObstacles = field(default_factory=NearObstacles)

    __repr__ = shapes_repr

    def __post_init__(self) -> None:
        for grid in (self.free, self.outside, self.passed):
            if grid.shape != self.seen_s.shape or grid.ndim != 2:
                raise ShapeError("map grid", expected=str(self.seen_s.shape), actual=grid.shape)

    @property
    def ground(self) -> Flags:
        """Cells that were seen to be ground."""
        return np.asarray(np.isfinite(self.seen_s))

    @property
    def ground_s(self) -> float:
        """When a view last showed ground; -inf before any has."""
        return float(self.seen_s.max(initial=-math.inf))

    def cell_of(self, x_m: float, y_m: float) -> tuple[int, int]:
        """Return the row and column of a place, which may lie outside the grid."""
        return (
            math.floor((x_m - self.corner_m[0]) / self.cell_m + 0.5),
            math.floor((y_m - self.corner_m[1]) / self.cell_m + 0.5),
        )

    def lies_on(self, cells: Flags, places_m: Floats) -> Flags:
        """Return which places lie on cells of one of its grids that are set.

        Args:
            cells: (rows, columns).
            places_m: (..., 2); those outside the grid, and NaN, lie on none.
        """
        steps = (places_m - np.array(self.corner_m)) / self.cell_m
        inside = ((steps >= -0.5) & (steps < np.array(cells.shape) - 0.5)).all(axis=-1)
        found = np.zeros(inside.shape, dtype=bool)
        found[inside] = cells[tuple(np.rint(steps[inside]).astype(np.intp).T)]
        return found

    def is_beyond_edge(self, x_m: float, y_m: float) -> bool:
        """Return whether a place lies beyond the edge of the ground, and further than a margin."""
        return is_beyond_edge(self.outside, *self.cell_of(x_m, y_m), self.cell_m)

    def places_m(self) -> Floats:
        """Return the centres of the cells, (rows, columns, 2)."""
        steps = np.moveaxis(np.indices(self.seen_s.shape), 0, -1)
        return np.asarray(np.array(self.corner_m) + self.cell_m * steps)


def is_beyond_edge(beyond: Flags | NDArray[np.int8], row: int, column: int, cell_m: float) -> bool:
    """Return whether a cell and all around it lie beyond the edge of the ground.

    Args:
        beyond: (rows, columns) positive where a cell does.
        row: of the cell, which may lie outside the grid.
        column: likewise.
        cell_m: side of a cell.
    """
    reach = round(EDGE_MARGIN_M / cell_m)
    rows = slice(max(row - reach, 0), max(row + reach + 1, 0))
    around = beyond[rows, max(column - reach, 0) : max(column + reach + 1, 0)]
    return bool(around.size) and bool((around > 0).all())
