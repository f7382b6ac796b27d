"""The site map of a mission: ground, obstacles, edges, objects, landing mark."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from uav_bt.errors import ShapeError
from uav_bt.lab.classes import LabClasses
from uav_bt.settings import brief_repr
from uav_bt.types.arrays import Flags, Floats
from uav_bt.types.pose import Pose2D
from uav_bt.types.surroundings import NearObstacles

EDGE_MARGIN_M: Final = 0.3  # m beyond the edge, from which a place counts as outside; chosen


@dataclass(frozen=True, kw_only=True)
class MapObject:
    """An object on the ground; size and place are those of the seen part of its base."""

    class_id: int  # `site_map.classes.names` has the names by id
    x_m: float  # the middle of its base, in the map's frame
    y_m: float
    size_m: float  # seen length of the longer side of its base
    std_m: float  # one standard deviation of the position
    seen_s: float  # the capture of the newest frame that showed its base
    width_m: float = 0.0  # of the shorter side
    yaw_rad: float = 0.0  # of the longer side, from the map's x towards its y
    id: int = 0  # unique in a mission, from 1; 0 before it has one
    points: int = 0  # number of the map's points on its base
    height_m: float | None = None  # above the ground; None while no view showed where it ends
    height_std_m: float | None = None  # one standard deviation of the height

    def covers(self, x_m: float, y_m: float, *, margin_m: float = 0.0) -> bool:
        """Return whether a place lies on its base or within a margin around it."""
        middle = Pose2D(x_m=self.x_m, y_m=self.y_m, yaw_rad=self.yaw_rad)
        along_m, across_m = middle.to_body(x_m, y_m)
        longer_m, shorter_m = self.size_m / 2 + margin_m, self.width_m / 2 + margin_m
        return abs(along_m) <= longer_m and abs(across_m) <= shorter_m

    def corners_m(self, *, margin_m: float = 0.0) -> Floats:
        """Return the corners of its base and a margin around, (4, 2) in the map's frame."""
        middle = Pose2D(x_m=self.x_m, y_m=self.y_m, yaw_rad=self.yaw_rad)
        return np.array(middle.rectangle(self.size_m / 2 + margin_m, self.width_m / 2 + margin_m))

    def outline_m(self, step_m: float) -> Floats:
        """Return points, (N, 2), on the sides of its base, at most a step apart."""
        corners_m = self.corners_m()
        count = max(1, math.ceil(max(self.size_m, self.width_m) / step_m))
        shares = np.arange(count)[:, None] / count
        sides_m = np.roll(corners_m, -1, axis=0) - corners_m
        return (corners_m[:, None] + shares * sides_m[:, None]).reshape(-1, 2)


@dataclass(frozen=True, kw_only=True)
class MapMark:
    """The landing mark in the map."""

    x_m: float  # its middle, in the map's frame
    y_m: float
    std_m: float  # one standard deviation of the position
    seen_s: float  # the capture of the newest frame that showed it
    moved_m: float = 0.0  # sum of the distances by which the mark was moved on the map
    # Direction of its upper edge, clockwise from the map's x; None if the mark does not show it.
    yaw_rad: float | None = None


@dataclass(frozen=True, kw_only=True)
class MapMover:
    """A mover: position at the time of the map's pose, and velocity."""

    id: int  # unique in a mission
    x_m: float  # its middle, in the map's frame
    y_m: float
    x_mps: float  # its velocity, in the map's frame
    y_mps: float
    std_m: float  # one standard deviation of the position, the larger axis
    std_mps: float  # the same of the velocity
    radius_m: float  # of a circle around its base
    first_s: float  # capture times of the first and last frame that showed it
    seen_s: float

    @property
    def speed_mps(self) -> float:
        """Speed of the mover."""
        return math.hypot(self.x_mps, self.y_mps)

    def at(self, ahead_s: float | Floats) -> Floats:
        """Return where it is some seconds after the map's pose, (..., 2) in the map's frame."""
        later = np.asarray(ahead_s, dtype=float)[..., None]
        return np.asarray((self.x_m, self.y_m) + later * (self.x_mps, self.y_mps))


@dataclass(frozen=True, kw_only=True, eq=False)
class SiteMapBase:
    """A site map without its grids, as records keep it."""

    pose: Pose2D  # of the drone, now
    corner_m: tuple[float, float]  # the centre of the grids' cell (0, 0)
    cell_m: float  # side of a cell
    obstacles_m: Floats  # (N, 2) points of obstacles
    edges_m: Floats  # (K, 2) points of the edge of the ground
    captured_s: float  # capture of the newest view
    movers: tuple[MapMover, ...] = ()  # the movers; they are not among the obstacles
    moved_s: float = -math.inf  # time of the last seen movement; -inf before the first one
    # (L, 2) places where something moved and that no view has shown since
    lanes_m: Floats = field(default_factory=lambda: np.empty((0, 2)))
    objects: tuple[MapObject, ...] = ()  # obstacles with class, place and size
    mark: MapMark | None = None  # the landing mark; None before it was seen
    # The pose of the dead-reckoned frame in the map's frame
    correction: Pose2D = field(default_factory=lambda: Pose2D(x_m=0.0, y_m=0.0, yaw_rad=0.0))
    residual_m: float = 0.0  # mean distance of views' points from their counterparts on the map
    contradicted_s: float = 0.0  # time for which views have contradicted the map
    restarts: int = 0  # number of times the map was begun again, because of that
    full: bool = False  # whether part of the room lies beyond the grid
    untracked_s: float = 0.0  # time for which the odometry has followed no ground
    # The take-off pose: the drone's pose when the map began. Places of tree files count from it
    start: Pose2D = field(default_factory=lambda: Pose2D(x_m=0.0, y_m=0.0, yaw_rad=0.0))

    def object(self, object_id: int | None) -> MapObject | None:
        """Return the object with an id; None if the map does not have it."""
        return next((each for each in self.objects if each.id == object_id), None)


@dataclass(frozen=True, kw_only=True, eq=False)
class SiteMap(SiteMapBase):
    """Grids around the take-off point, obstacles in them, and obstacles near the drone.

    The frame is that of dead reckoning: x along heading 0 of the telemetry, y to its right, the
    origin where the mission began; `start` is the take-off pose in it. Views correct the drone's
    pose. All grids have the same shape, rows along x and columns along y.
    """

    classes: LabClasses  # classes of the objects
    seen_s: Floats  # (R, C) float64 when the cell last showed ground; -inf: never
    # (R, C) cells known to be free to fly: ground, or below a line of sight to the ground
    free: Flags
    outside: Flags  # (R, C) cells beyond the edge of the ground
    passed: Flags  # (R, C) cells within half a metre of the flown path
    # Obstacles and edges near the drone, relative to `pose`, placed by dead reckoning; including
    # those that only a few views have seen, and those of unknown range
    near: NearObstacles = field(default_factory=NearObstacles)

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        for grid in (self.free, self.outside, self.passed):
            if grid.shape != self.seen_s.shape or grid.ndim != 2:
                raise ShapeError("map grid", expected=str(self.seen_s.shape), actual=grid.shape)

    @cached_property
    def ground(self) -> Flags:
        """Cells in which ground was seen."""
        return np.asarray(np.isfinite(self.seen_s))

    @property
    def ground_s(self) -> float:
        """Capture time of the last view that showed ground; -inf without one."""
        return float(self.seen_s.max(initial=-math.inf))

    def cell_of(self, x_m: float, y_m: float) -> tuple[int, int]:
        """Return row and column of a place; they may lie outside the grid."""
        return (
            math.floor((x_m - self.corner_m[0]) / self.cell_m + 0.5),
            math.floor((y_m - self.corner_m[1]) / self.cell_m + 0.5),
        )

    def lies_on(self, cells: Flags, places_m: Floats) -> Flags:
        """Return which places, (..., 2), lie on set cells of a grid; False outside and for NaN."""
        steps = (places_m - np.array(self.corner_m)) / self.cell_m
        inside = ((steps >= -0.5) & (steps < np.array(cells.shape) - 0.5)).all(axis=-1)
        found = np.zeros(inside.shape, dtype=bool)
        found[inside] = cells[tuple(np.rint(steps[inside]).astype(np.intp).T)]
        return found

    def is_beyond_edge(self, x_m: float, y_m: float) -> bool:
        """Return whether a place lies beyond the edge of the ground by more than a margin."""
        return is_beyond_edge(self.outside, *self.cell_of(x_m, y_m), self.cell_m)

    def places_m(self) -> Floats:
        """Return the centres of the cells, (rows, columns, 2)."""
        return self.middles_m(np.moveaxis(np.indices(self.seen_s.shape), 0, -1))

    def middles_m(self, cells: NDArray[np.intp]) -> Floats:
        """Return the centres, (..., 2), of rows and columns, (..., 2), also outside the grid."""
        return np.asarray(np.array(self.corner_m) + self.cell_m * cells)


def is_beyond_edge(beyond: Flags | NDArray[np.int8], row: int, column: int, cell_m: float) -> bool:
    """Return whether a cell and all around it lie beyond the edge of the ground.

    `beyond` is positive for cells beyond the edge; the cell may lie outside the grid.
    """
    reach = round(EDGE_MARGIN_M / cell_m)
    rows = slice(max(row - reach, 0), max(row + reach + 1, 0))
    around = beyond[rows, max(column - reach, 0) : max(column + reach + 1, 0)]
    return bool(around.size) and bool((around > 0).all())
