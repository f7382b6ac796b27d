"""Clearance map: flyable cells of a site map, their distance from obstacles, and routes."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from behaviours.path.fastest import Cell, FastestPaths, fastest_paths
from behaviours.path.margins import START_SLACK_M, YAW_RATE_RADPS, Margins
from behaviours.path.movers import outlines_m
from behaviours.path.nearby import RecentObstacles
from uav_bt.types.arrays import Flags, Floats
from uav_bt.types.site_map import SiteMap

Place = tuple[float, float]  # (x, y), metres in the map's frame

_ROUNDING_M: Final = 1e-6  # distances on the grid that differ by less are equal
_SHARES: Final = np.linspace(0.0, 1.0, 10)[:, None]  # samples of a line of about 0.6 m (`follow`)
_START_M: Final = 0.7  # m; within this distance a route may keep the drone's present clearance
_ENOUGH_REACHED: Final = 0.5  # share of the flyable cells below which the drone is shut in
_TURN_M: Final = 0.5  # m; length of the route over which the time of its first turn is spread
_CROSS_M: Final = 1.2  # m; distance from the mark up to which a route may cross unseen cells
_UNKNOWN_TIMES: Final = 3.0  # factor on the flight time of such cells


@dataclass(frozen=True, kw_only=True)
class Route:
    """A path over the map."""

    path_m: Floats  # (N, 2) places from the drone to the end, metres in the map's frame
    clear_m: Floats  # (N,) clearance of each place, as `ClearanceMap.clearance_at` returns it
    straight_m: Floats  # (N,) least clearance on the straight line from the drone to each place
    time_s: float  # to fly the route
    margins: Margins  # that it keeps
    new_m2: float = 0.0  # new ground along it; 0 if it was not computed

    @property
    def length_m(self) -> float:
        """The length of the path, metres."""
        return float(np.hypot(*np.diff(self.path_m, axis=0).T).sum())

    @property
    def apart_m(self) -> float:
        """The straight distance between the ends of the path, metres."""
        return float(np.hypot(*(self.path_m[-1] - self.path_m[0])))


class Distances:
    """The distance of each cell from obstacles and edges; clearance maps of one map share it."""

    def __init__(self, site_map: SiteMap, recent: RecentObstacles) -> None:
        self._map, self._recent = site_map, recent

    @cached_property
    def obstacle_m(self) -> Floats:
        """(rows, columns) distance to the nearest obstacle, metres; inf without any."""
        found = self._map
        points_m = np.vstack([found.obstacles_m, outlines_m(found.movers), self._recent.seen_m])
        return self.of(self._marked(points_m) | self._filled())

    @cached_property
    def edge_m(self) -> Floats:
        """(rows, columns) distance to the nearest edge of the ground, metres; inf without any."""
        ends = self._marked(np.vstack([self._map.edges_m, self._recent.edges_m]))
        return self.of(ends | self._map.outside)

    @cached_property
    def lane_m(self) -> Floats:
        """(rows, columns) distance to the nearest lane of movers, metres; inf without any."""
        return self.of(self._marked(self._map.lanes_m))

    @cached_property
    def assumed(self) -> Flags:
        """(rows, columns) cells of assumed obstacles."""
        return self._marked(self._recent.assumed_m)

    def of(self, marked: Flags) -> Floats:
        """Return the distance of each cell to the nearest marked one, metres; inf without any."""
        import cv2  # noqa: PLC0415  (`uav-bt check` must answer at once)

        if not marked.any():
            return np.full(marked.shape, math.inf)
        apart = cv2.distanceTransform((~marked).view(np.uint8), cv2.DIST_L2, 5)
        return np.asarray(np.multiply(apart, self._map.cell_m, dtype=np.float64))

    def _marked(self, points_m: Floats) -> Flags:
        """Return the cells with a point, (N, 2) in the map's frame."""
        marked = np.zeros(self._map.seen_s.shape, dtype=bool)
        if len(points_m):
            cells = self._cells(points_m)
            inside = ((cells >= 0) & (cells < marked.shape)).all(axis=1)
            marked[tuple(cells[inside].T)] = True
        return marked

    def _cells(self, points_m: Floats) -> NDArray[np.intp]:
        apart_m = points_m - np.array(self._map.corner_m)
        return np.asarray(np.rint(apart_m / self._map.cell_m).astype(np.intp))

    def _filled(self) -> Flags:
        """Return the cells that objects fill, including sides that were never seen."""
        import cv2  # noqa: PLC0415  (`uav-bt check` must answer at once)

        filled = np.zeros(self._map.seen_s.shape, dtype=np.uint8)
        margin_m = -self._map.cell_m / 2
        corners_m = [each.corners_m(margin_m=margin_m) for each in self._map.objects]
        if corners_m:
            # OpenCV's x is the column. It also fills the cells of the border.
            for corners in self._cells(np.stack(corners_m))[..., ::-1].astype(np.int32):
                cv2.fillConvexPoly(filled, corners, 1)
        return filled.view(np.bool_)


class ClearanceMap:
    """The clearance of every cell of a site map, the flyable cells, and the paths over them.

    Attributes:
        map: The site map.
        margins: The margins, widened by the map's residual.
        obstacle_m: (rows, columns) distance to the nearest obstacle, metres; inf without any.
        clear_m: (rows, columns) clearance, as `clearance_at` returns it.
        free: (rows, columns) whether the cell was seen free, or may be crossed unseen.
        open: (rows, columns) whether a route may lead over the cell.
        start: Row and column of the drone.

    Args:
        site_map: The newest map.
        recent: Obstacles that are not on the map.
        margins: The distances that routes keep.
        over: Landing mark that routes may lead over, (x, y) metres in the map's frame. Ground
            within `margins.over_mark_m` of it counts as seen and free.
        distances: Distances on this map with these obstacles; default: computed here.
    """

    def __init__(
        self,
        site_map: SiteMap,
        recent: RecentObstacles,
        margins: Margins | None = None,
        *,
        over: Place | None = None,
        distances: Distances | None = None,
    ) -> None:
        distances = distances or Distances(site_map, recent)
        self.map = site_map
        self.margins = margins = (margins or Margins()).by(site_map.residual_m)
        self.free = site_map.free
        if over is not None:
            self.free = self.free | self._around(over, margins.over_mark_m)
        self._doubted: Flags | None = None  # cells that may hold an obstacle; None: none
        if margins.cross_unknown:
            beside = self._around(over, _CROSS_M) if over is not None else True
            unseen = ~(self.free | site_map.outside) & beside
            self._doubted = unseen | (distances.of(distances.assumed) < margins.doubt_m)
            self.free = self.free | unseen
        self.obstacle_m = distances.obstacle_m
        self.clear_m = self._clearance_m(distances)
        self.start: Cell = self._within(site_map.cell_of(site_map.pose.x_m, site_map.pose.y_m))
        flyable = self.free & ~site_map.outside
        self.open = flyable & self.roomy
        here_m = float(self.clear_m[self.start])
        as_near_m = min(here_m, max(margins.min_start_m, here_m - START_SLACK_M))
        near, from_start_m = self._from_start_m(_START_M)
        as_clear = self.clear_m[near] >= as_near_m
        self.open[near] |= flyable[near] & (from_start_m <= _START_M) & as_clear
        self.open[self.start] = True

    def _clearance_m(self, distances: Distances) -> Floats:
        """Return the clearance of each cell: all distances, each margin shifted to `touch_m`."""
        margins, clear_m = self.margins, self.obstacle_m
        blocking, slowing = self._assumed(distances.assumed)
        nearer_m = margins.touch_m - margins.doubt_m
        if blocking.any():
            clear_m = np.minimum(clear_m, distances.of(blocking) + nearer_m)
        if slowing.any():
            slower_m = np.maximum(distances.of(slowing) + nearer_m, margins.touch_m)
            clear_m = np.minimum(clear_m, slower_m)
        if len(self.map.lanes_m):
            clear_m = np.minimum(clear_m, distances.lane_m + margins.touch_m - margins.lane_m)
        unknown_m = distances.of(self.unknown())
        clear_m = np.minimum(clear_m, unknown_m + margins.touch_m - margins.unknown_m)
        return np.minimum(clear_m, distances.edge_m + margins.touch_m - margins.edge_m)

    def clearance_at(self, x_m: float, y_m: float) -> float:
        """Return the clearance of a place, metres.

        The clearance is the distance to the nearest obstacle. Edges, lanes, unknown cells and
        assumed obstacles also count, each shifted so that its margin falls on `margins.touch_m`.
        Routes lead over cells with at least that clearance.

        Args:
            x_m: x of the place in the map's frame; outside the grid the nearest cell counts.
            y_m: y of the place in the map's frame.
        """
        return float(self.clear_m[self._within(self.map.cell_of(x_m, y_m))])

    @cached_property
    def roomy(self) -> Flags:
        """(rows, columns) whether the cell has the clearance that routes need."""
        return np.asarray(self.clear_m >= self.margins.touch_m - _ROUNDING_M)

    @cached_property
    def fastest(self) -> FastestPaths:
        """The fastest paths from the drone to all cells, without the cost of the first turn."""
        return fastest_paths(self.open, self._cell_s(), self.start)

    @cached_property
    def _turned(self) -> FastestPaths:
        """The fastest paths with the cost of the first turn, which favours the present heading.

        The turn to a cell near the drone is added to its cost, spread over the first `_TURN_M`.
        """
        found = self.map
        near, _ = self._from_start_m(_TURN_M + 2.0 * found.cell_m)
        places_m = found.middles_m(np.moveaxis(np.mgrid[near], 0, -1))
        forward_m, right_m = np.moveaxis(found.pose.points_to_body(places_m), -1, 0)
        turn_s = np.abs(np.arctan2(right_m, forward_m)) / YAW_RATE_RADPS
        around = np.hypot(forward_m, right_m) <= _TURN_M
        cell_s = self._cell_s()
        cell_s[near] += np.where(around, found.cell_m / _TURN_M, 0.0) * turn_s
        return fastest_paths(self.open, cell_s, self.start)

    def _cell_s(self) -> Floats:
        """Return the time to fly one side length of each cell, seconds; inf if not open."""
        cell_s = np.full(self.open.shape, math.inf)
        cell_s[self.open] = self.map.cell_m / self.margins.speed_mps(self.clear_m[self.open])
        if self._doubted is not None:
            cell_s[self._doubted] *= _UNKNOWN_TIMES
        return cell_s

    def route_to(self, to: Place, *, near_m: float, far_m: float) -> Route | None:
        """Return the fastest route to the surroundings of a place; None without one.

        Args:
            to: Place in the map's frame, metres.
            near_m: The fastest route that ends within this distance is preferred.
            far_m: Without such a route, the one that ends nearest is taken, within this distance.
        """
        paths = self._turned
        cells = np.stack(np.divmod(paths.reached, paths.time_s.shape[1]), axis=-1)
        time_s = paths.time_s.reshape(-1)[paths.reached]
        apart_m = np.linalg.norm(self.map.middles_m(cells) - to, axis=-1)
        end = int(np.where(apart_m <= near_m, time_s, math.inf).argmin())
        if apart_m.min() > near_m:
            end = int(apart_m.argmin())
        if apart_m[end] > max(near_m, far_m):
            return None
        row, column = map(int, cells[end])
        return self.route_along(paths.to((row, column)), time_s=float(time_s[end]))

    def route_along(self, path: list[Cell], *, time_s: float, new_m2: float = 0.0) -> Route:
        """Return the route along a path over cells."""
        cells = np.array(path)
        lines = np.rint(cells[0] + _SHARES * (cells - cells[0])[:, None]).astype(int)
        return Route(
            path_m=self.map.middles_m(cells),
            clear_m=self.clear_m[tuple(cells.T)],
            straight_m=self.clear_m[tuple(np.moveaxis(lines, -1, 0))].min(axis=-1),
            time_s=time_s,
            margins=self.margins,
            new_m2=new_m2,
        )

    def is_open_to(self, x_m: float, y_m: float) -> bool:
        """Return whether the straight line from the drone to a place leads over open cells only."""
        end = self.map.cell_of(x_m, y_m)
        if self._within(end) != end:
            return False
        rows, columns = np.rint(self.start + _SHARES * (np.array(end) - self.start)).astype(int).T
        return bool(self.open[rows, columns].all())

    def is_open(self, place: Place) -> bool:
        """Return whether a place lies on an open cell."""
        return bool(self.map.lies_on(self.open, np.array(place)))

    @property
    def shut_in(self) -> bool:
        """Whether too few of the flyable cells can be reached."""
        wide = self.open & self.roomy
        reached = np.isfinite(self.fastest.time_s) & wide
        return bool(reached.sum() < _ENOUGH_REACHED * wide.sum())

    @property
    def too_narrow(self) -> bool:
        """Whether no cell has the clearance that routes need."""
        return not (self.open & self.roomy).any()

    def _around(self, place: Place, reach_m: float) -> Flags:
        apart_m = np.linalg.norm(self.map.places_m() - place, axis=-1)
        return np.asarray(apart_m <= reach_m)

    def _from_start_m(self, reach_m: float) -> tuple[tuple[slice, slice], Floats]:
        """Return a window with all cells within a reach of the start, and their distances."""
        reach = math.ceil(reach_m / self.map.cell_m)
        (row, column), shape = self.start, self.clear_m.shape
        near = (
            slice(max(row - reach, 0), min(row + reach + 1, shape[0])),
            slice(max(column - reach, 0), min(column + reach + 1, shape[1])),
        )
        rows, columns = np.ogrid[near]
        return near, self.map.cell_m * np.hypot(rows - row, columns - column)

    def unknown(self) -> Flags:
        """Return the cells of unknown patches; single cells between rays are left out."""
        import cv2  # noqa: PLC0415  (`uav-bt check` must answer at once)

        unknown = (~(self.free | self.map.outside)).view(np.uint8)
        square = np.ones((2, 2), np.uint8)
        # OpenCV anchors an even kernel at its lower right cell. Without the other anchor the
        # dilation would shift the opened patches by a cell.
        patches = cv2.dilate(cv2.erode(unknown, square), square, anchor=(0, 0))
        return np.asarray(patches.view(np.bool_))

    def _assumed(self, marked: Flags) -> tuple[Flags, Flags]:
        """Return the cells of assumed obstacles: those that block, and those that only slow down.

        Seen, open ground cannot hold an obstacle with a hidden base, unless something moves there.
        Near an obstacle of the map the assumed one is taken for that obstacle, and the map for
        displaced.
        """
        found = self.map
        if self.margins.cross_unknown:
            return np.zeros_like(marked), marked
        trusted = self.margins.past_assumed and not found.movers and not len(found.lanes_m)
        is_open = trusted & found.ground & (self.obstacle_m >= self.margins.doubt_m)
        return marked & ~is_open, marked & is_open

    def _within(self, cell: Cell) -> Cell:
        rows, columns = self.map.seen_s.shape
        return min(max(cell[0], 0), rows - 1), min(max(cell[1], 0), columns - 1)
