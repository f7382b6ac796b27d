"""What of a map can be flown, how near to things, and how fast there."""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from behaviours.path.fastest import Cell, FastestPaths, fastest_paths
from behaviours.path.movers_ahead import outlines_m
from uav_bt.errors import ValueRangeError
from uav_bt.types.site_map import SiteMap

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

_LINE_SAMPLES: Final = 10  # on a line as long as the drone looks ahead


class Passage(enum.Enum):
    """How much room the legs of a map leave beside them."""

    ORDINARY = "ordinary"
    TIGHT = "tight"
    TIGHTEST = "tightest"


@dataclass(frozen=True, kw_only=True)
class Margins:
    """How near to things a leg may pass, and how fast it is flown there.

    Distances are from the body's centre, half of whose diagonal is 0.2 m.
    """

    touch_m: float = 0.40  # no leg passes an obstacle nearer: a hull's 0.2 m, drift, and sway
    wide_m: float = 0.75  # from here on the full speed
    tight_m: float = 0.34  # where legs with all that room lead nowhere
    tightest_m: float = 0.30  # where without it there is no way out of where the drone flew in
    # Views of a drone that knows well where it is, and how high, are off the map by so much. What
    # they are off more is added, so many times, to the distance from obstacles and edges.
    sure_m: float = 0.016
    unsure_times: float = 8.0
    unsure_m: float = 0.12  # no more is added
    doubt_m: float = 0.38  # no leg passes nearer to where an obstacle is only assumed,
    past_assumed: bool = False  # but over open ground that was seen, if this is set
    unknown_m: float = 0.35  # what was never seen may be the hidden side of a box
    lane_m: float = 0.7  # where something moved and may come back while nobody looks
    edge_m: float = 0.30  # no leg passes the edge of the ground nearer
    slow_mps: float = 0.3  # at the smallest distance
    fast_mps: float = 0.6
    away_mps: float = 0.1  # where the drone begins nearer: the shortest way is away
    # Around the drone, which may be nearer to something already, a leg goes on as near, not nearer.
    start_m: float = 0.7
    start_slack_m: float = 0.03
    min_start_m: float = 0.3  # nearer, it only leads away
    enough_reached: float = 0.5  # of what can be flown: with less in reach, the drone is shut in

    def __post_init__(self) -> None:
        speeds_mps = (self.away_mps, self.slow_mps, self.fast_mps)
        in_order = tuple(sorted(speeds_mps)) == speeds_mps
        apart = self.min_start_m <= self.touch_m < self.wide_m
        if self.away_mps <= 0.0 or not in_order or not apart:
            raise ValueRangeError(f"speeds and distances must be positive and in order, got {self}")

    def by(self, residual_m: float) -> Margins:
        """Return how near legs may pass with views that are so far off the map."""
        more_m = min(self.unsure_times * max(residual_m - self.sure_m, 0.0), self.unsure_m)
        return replace(
            self,
            touch_m=self.touch_m + more_m,
            wide_m=self.wide_m + more_m,
            doubt_m=self.doubt_m + more_m,
            edge_m=self.edge_m + more_m,
        )

    def tight(self) -> Margins:
        """Return how near legs pass in narrow places."""
        return replace(self, touch_m=self.tight_m)

    def tightest(self) -> Margins:
        """Return how near legs pass where the drone is shut in, however well it knows its place."""
        return replace(self, touch_m=self.tightest_m, unsure_m=0.0)

    def speed_mps(self, clear_m: Floats) -> Floats:
        """Return how fast the drone flies with so much room around it."""
        at_m = self.min_start_m, self.touch_m, self.wide_m
        return np.interp(clear_m, at_m, (self.away_mps, self.slow_mps, self.fast_mps))


def _nothing() -> Floats:
    return np.empty((0, 2))


@dataclass(frozen=True, kw_only=True)
class Route:
    """A path to fly, and what it is worth."""

    path_m: Floats  # (N, 2) from the drone to the end, in the map's frame
    clear_m: Floats  # (N,) room around each place
    straight_m: Floats  # (N,) the least room on the straight line from the drone to each place
    time_s: float
    new_m2: float  # ground that it passes for the first time


@dataclass(frozen=True, kw_only=True, eq=False)
class RecentObstacles:
    """What was seen lately around the drone, in the map's frame."""

    seen_m: Floats = field(default_factory=_nothing)  # (N, 2) obstacles
    assumed_m: Floats = field(default_factory=_nothing)  # (M, 2) where they are assumed
    edges_m: Floats = field(default_factory=_nothing)  # (K, 2) where the ground ends


class ClearanceMap:
    """What of a map can be flown, and how far everything is from obstacles and edges.

    Args:
        site_map: as it is known now.
        lately: what was seen besides.
        margins: how near legs may pass.
    """

    def __init__(
        self,
        site_map: SiteMap,
        lately: RecentObstacles,
        margins: Margins | None = None,
    ) -> None:
        margins = (margins or Margins()).by(site_map.residual_m)
        self.map, self.margins = site_map, margins
        standing = self._marked(
            np.vstack([site_map.obstacles_m, outlines_m(site_map.movers), lately.seen_m])
        )
        self.obstacle_m = self._distance_of(standing | self._filled())
        ends_m = self._distance_m(np.vstack([site_map.edges_m, lately.edges_m]))
        edge_m = np.minimum(ends_m, self._distance_of(site_map.outside))
        # In one measure: what may be passed nearer counts as so much further away.
        closing, slowing = self._assumed(lately.assumed_m)
        nearer_m = margins.touch_m - margins.doubt_m
        room = np.minimum(self.obstacle_m, self._distance_of(closing) + nearer_m)
        slower = np.maximum(self._distance_of(slowing) + nearer_m, margins.touch_m)
        room = np.minimum(room, slower)
        lane_m = self._distance_m(site_map.lanes_m)
        room = np.minimum(room, lane_m + margins.touch_m - margins.lane_m)
        room = np.minimum(room, self._unknown_m() + margins.touch_m - margins.unknown_m)
        self.clear_m = np.minimum(room, edge_m + margins.touch_m - margins.edge_m)
        self.start: Cell = self._within(site_map.cell_of(site_map.pose.x_m, site_map.pose.y_m))
        rows, columns = np.indices(self.clear_m.shape)
        from_start_m = site_map.cell_m * np.hypot(rows - self.start[0], columns - self.start[1])
        flyable = site_map.free & ~site_map.outside
        self.open = flyable & (self.clear_m >= margins.touch_m)
        here_m = float(self.clear_m[self.start])
        as_near_m = min(here_m, max(margins.min_start_m, here_m - margins.start_slack_m))
        self.open |= flyable & (from_start_m <= margins.start_m) & (self.clear_m >= as_near_m)
        self.open[self.start] = True

    @cached_property
    def fastest(self) -> FastestPaths:
        """The fastest paths from the drone to everywhere."""
        cell_s = self.map.cell_m / self.margins.speed_mps(self.clear_m)
        return fastest_paths(self.open, cell_s, self.start)

    def leg(self, path: list[Cell], *, time_s: float, new_m2: float = 0.0) -> Route:
        """Return a path as it is flown."""
        cells = np.array(path)
        return Route(
            path_m=np.array(self.map.corner_m) + self.map.cell_m * cells,
            clear_m=self.clear_m[tuple(cells.T)],
            straight_m=self._straight_m(cells),
            time_s=time_s,
            new_m2=new_m2,
        )

    def _straight_m(self, cells: NDArray[np.intp]) -> Floats:
        """Return the least room on the straight lines from the first to each of (N, 2) cells."""
        shares = np.linspace(0.0, 1.0, _LINE_SAMPLES)[:, None]
        lines = np.rint(cells[0] + shares * (cells - cells[0])[:, None]).astype(int)
        return np.asarray(self.clear_m[tuple(np.moveaxis(lines, -1, 0))].min(axis=-1))

    @cached_property
    def _wide(self) -> Flags:
        return self.open & (self.clear_m >= self.margins.touch_m)

    @property
    def shut_in(self) -> bool:
        """Whether most of what can be flown is out of reach from here."""
        reached = np.isfinite(self.fastest.time_s) & self._wide
        return bool(reached.sum() < self.margins.enough_reached * self._wide.sum())

    @property
    def too_narrow(self) -> bool:
        """Whether nowhere is as much room as legs ask for."""
        return not self._wide.any()

    def _unknown_m(self) -> Floats:
        """Return how far the unknown is; single cells that no ray has met are none."""
        import cv2  # noqa: PLC0415  (`uav-bt check` must answer at once)

        unknown = (~(self.map.free | self.map.outside)).astype(np.uint8)
        square = np.ones((2, 2), np.uint8)
        # OpenCV anchors an even kernel at its lower right cell; opened by that it would be moved.
        patches = cv2.dilate(cv2.erode(unknown, square), square, anchor=(0, 0))
        return self._distance_of(patches.astype(bool))

    def _assumed(self, places_m: Floats) -> tuple[Flags, Flags]:
        """Return the cells where obstacles are assumed: those that no leg passes, and the others.

        On open ground that was seen nothing stands whose foot is hidden, unless something moves
        here. Near an obstacle of the map it is that obstacle, and the map is displaced.
        """
        marked, found = self._marked(places_m), self.map
        trusted = self.margins.past_assumed and not found.movers and not len(found.lanes_m)
        is_open = trusted & found.ground & (self.obstacle_m >= self.margins.doubt_m)
        return marked & ~is_open, marked & is_open

    def _within(self, cell: Cell) -> Cell:
        rows, columns = self.map.seen_s.shape
        return min(max(cell[0], 0), rows - 1), min(max(cell[1], 0), columns - 1)

    def _distance_m(self, points_m: Floats) -> Floats:
        return self._distance_of(self._marked(points_m))

    def _cells(self, points_m: Floats) -> NDArray[np.intp]:
        apart_m = points_m - np.array(self.map.corner_m)
        return np.asarray(np.rint(apart_m / self.map.cell_m).astype(np.intp))

    def _marked(self, points_m: Floats) -> Flags:
        cells = self._cells(points_m)
        inside = ((cells >= 0) & (cells < self.map.seen_s.shape)).all(axis=1)
        marked = np.zeros(self.map.seen_s.shape, dtype=bool)
        marked[tuple(cells[inside].T)] = True
        return marked

    def _filled(self) -> Flags:
        """Return the cells that objects fill, the sides included that were never seen."""
        import cv2  # noqa: PLC0415  (`uav-bt check` must answer at once)

        filled = np.zeros(self.map.seen_s.shape, dtype=np.uint8)
        for each in self.map.objects:
            # OpenCV's x is the column; the cells on the border are filled, too.
            corners_m = each.corners_m(margin_m=-self.map.cell_m / 2)
            cv2.fillConvexPoly(filled, self._cells(corners_m)[:, ::-1].astype(np.int32), 1)
        return filled.astype(bool)

    def _distance_of(self, marked: Flags) -> Floats:
        import cv2  # noqa: PLC0415  (`uav-bt check` must answer at once)

        if not marked.any():
            return np.full(marked.shape, math.inf)
        free = (~marked).astype(np.uint8)
        return self.map.cell_m * cv2.distanceTransform(free, cv2.DIST_L2, 5).astype(np.float64)


class ClearanceMaps:
    """What of a map can be flown with each width of legs, worked out when it is asked for.

    Args:
        site_map: as it is known now.
        lately: what was seen besides.
        margins: of the ordinary width.
        crossing: whether narrower legs lead through where something moved, too.
        past_assumed: whether the narrowest lead over open ground where an obstacle is assumed.
    """

    def __init__(
        self,
        site_map: SiteMap,
        lately: RecentObstacles,
        margins: Margins,
        *,
        crossing: bool = False,
        past_assumed: bool = False,
    ) -> None:
        narrow = replace(site_map, lanes_m=_nothing()) if crossing else site_map
        self._parts = {
            Passage.ORDINARY: (site_map, margins),
            Passage.TIGHT: (narrow, margins.tight()),
            Passage.TIGHTEST: (narrow, replace(margins.tightest(), past_assumed=past_assumed)),
        }
        self._lately = lately
        self._rooms: dict[Passage, ClearanceMap] = {}

    def __getitem__(self, width: Passage) -> ClearanceMap:
        if width not in self._rooms:
            site_map, margins = self._parts[width]
            self._rooms[width] = ClearanceMap(site_map, self._lately, margins)
        return self._rooms[width]
