"""Where to fly to cover a place: the leg that passes the most new ground in a second.

A next-best-view planner (Connolly, 1985; Bircher et al., 2016) over the site map: the fastest
path to every place that is known to be free, at speeds that the room around it allows, and on each
the ground within half a metre that has not been passed yet. Ground that was not seen yet counts,
too, where it may be: it lies beside known ground.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from behaviours.path.fastest import Cell, FastestPaths, fastest_paths
from behaviours.path.moving import taken_m
from uav_bt.errors import ValueRangeError
from uav_bt.types.site_map import SiteMap

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]


@dataclass(frozen=True, kw_only=True)
class SurveyConfig:
    """How near to things a leg may pass, how fast it is flown, and what it is worth.

    Distances are from the body's centre, half of whose diagonal is 0.2 m.
    """

    touch_m: float = 0.42  # no leg passes an obstacle nearer: a decimetre is the map's drift
    wide_m: float = 0.75  # from here on the full speed
    doubt_m: float = 0.38  # no leg passes nearer to where an obstacle is only assumed
    unknown_m: float = 0.3  # what was never seen may be the hidden side of a box
    edge_m: float = 0.30  # no leg passes the edge of the ground nearer
    slow_mps: float = 0.3  # at the smallest distance
    fast_mps: float = 0.6
    # Around the drone, which may be nearer to something already, a leg goes on as near, not nearer.
    start_m: float = 0.7
    start_slack_m: float = 0.03
    least_start_m: float = 0.3  # nearer, it only leads away
    enough_reached: float = 0.5  # of what can be flown: with less in reach, the drone is shut in
    reach_m: float = 0.5  # ground so near to the path counts as passed
    unseen_worth: float = 0.5  # of a cell that may be ground, beside one that is
    yaw_rate_radps: float = 0.8  # of the first turn
    leg_s: float = 1.0  # lost at the end of each leg
    grid_step: int = 3  # of the ends that are tried, cells
    stamp_step: int = 3  # of the places on a path whose surroundings are counted, cells
    least_m2: float = 0.06  # a leg that passes less new ground is not worth it
    ahead_m: float = 0.6  # on the path: where the drone steers to

    def __post_init__(self) -> None:
        if not 0.0 < self.slow_mps <= self.fast_mps or not self.touch_m < self.wide_m:
            raise ValueRangeError(f"speeds and distances must be positive and in order, got {self}")

    def speed_mps(self, clear_m: Floats) -> Floats:
        """Return how fast the drone flies with so much room around it."""
        share = np.clip((clear_m - self.touch_m) / (self.wide_m - self.touch_m), 0.0, 1.0)
        return np.asarray(self.slow_mps + share * (self.fast_mps - self.slow_mps))


@dataclass(frozen=True, kw_only=True)
class Leg:
    """A path to fly, and what it is worth."""

    path_m: Floats  # (N, 2) from the drone to the end, in the map's frame
    clear_m: Floats  # (N,) room around each place
    time_s: float
    new_m2: float  # ground that it passes for the first time


class Room:
    """What of a map can be flown, and how far everything is from obstacles and edges.

    Args:
        site_map: as it is known now.
        seen_m: (N, 2) where obstacles were seen lately besides, in the map's frame.
        assumed_m: (M, 2) where they are assumed.
        config: how near legs may pass.
    """

    def __init__(
        self,
        site_map: SiteMap,
        seen_m: Floats,
        assumed_m: Floats,
        *,
        config: SurveyConfig | None = None,
    ) -> None:
        config = config or SurveyConfig()
        self.map, self.config = site_map, config
        standing = np.vstack([site_map.obstacles_m, taken_m(site_map.movers), seen_m])
        self.obstacle_m = self._distance_m(standing)
        doubt_m = self._distance_m(assumed_m)
        edge_m = np.minimum(self._distance_m(site_map.edges_m), self._distance_of(site_map.outside))
        # In one measure: what may be passed nearer counts as so much further away.
        room = np.minimum(self.obstacle_m, doubt_m + config.touch_m - config.doubt_m)
        room = np.minimum(room, self._unknown_m() + config.touch_m - config.unknown_m)
        self.clear_m = np.minimum(room, edge_m + config.touch_m - config.edge_m)
        self.start: Cell = self._within(site_map.cell_of(site_map.pose.x_m, site_map.pose.y_m))
        rows, columns = np.indices(self.clear_m.shape)
        from_start_m = site_map.cell_m * np.hypot(rows - self.start[0], columns - self.start[1])
        flyable = site_map.free & ~site_map.outside
        self.open = flyable & (self.clear_m >= config.touch_m)
        here_m = float(self.clear_m[self.start])
        as_near_m = min(here_m, max(config.least_start_m, here_m - config.start_slack_m))
        self.open |= flyable & (from_start_m <= config.start_m) & (self.clear_m >= as_near_m)
        self.open[self.start] = True

    @cached_property
    def fastest(self) -> FastestPaths:
        """The fastest paths from the drone to everywhere."""
        cell_s = self.map.cell_m / self.config.speed_mps(self.clear_m)
        return fastest_paths(self.open, cell_s, self.start)

    def leg(self, path: list[Cell], *, time_s: float, new_m2: float = 0.0) -> Leg:
        """Return a path as it is flown."""
        cells = np.array(path)
        return Leg(
            path_m=np.array(self.map.corner_m) + self.map.cell_m * cells,
            clear_m=self.clear_m[tuple(cells.T)],
            time_s=time_s,
            new_m2=new_m2,
        )

    @property
    def shut_in(self) -> bool:
        """Whether most of what can be flown is out of reach from here."""
        reached = np.isfinite(self.fastest.time_s)
        wide = self.open & (self.clear_m >= self.config.touch_m)
        return bool((reached & wide).sum() < self.config.enough_reached * wide.sum())

    def worth(self) -> Floats:
        """Return what it is worth to pass each cell: ground that was not passed, or may be."""
        import cv2  # noqa: PLC0415  (`uav-bt check` must answer at once)

        found, cfg = self.map, self.config
        standing = self.obstacle_m < 1.5 * found.cell_m
        ground = found.ground & ~found.outside
        near = cv2.dilate(ground.astype(np.uint8), np.ones((5, 5), np.uint8), borderValue=0).astype(
            bool
        )
        unseen = near & ~ground & ~found.outside & ~standing & ~found.free
        worth = np.where(ground & ~standing, 1.0, 0.0) + cfg.unseen_worth * unseen
        return np.asarray(np.where(found.passed, 0.0, worth))

    def _unknown_m(self) -> Floats:
        """Return how far the unknown is; single cells that no ray has met are none."""
        import cv2  # noqa: PLC0415  (`uav-bt check` must answer at once)

        unknown = (~(self.map.free | self.map.outside)).astype(np.uint8)
        patches = cv2.morphologyEx(unknown, cv2.MORPH_OPEN, np.ones((2, 2), np.uint8))
        return self._distance_of(patches.astype(bool))

    def _within(self, cell: Cell) -> Cell:
        rows, columns = self.map.seen_s.shape
        return min(max(cell[0], 0), rows - 1), min(max(cell[1], 0), columns - 1)

    def _distance_m(self, points_m: Floats) -> Floats:
        found = self.map
        cells = np.rint((points_m - np.array(found.corner_m)) / found.cell_m).astype(int)
        inside = ((cells >= 0) & (cells < found.seen_s.shape)).all(axis=1)
        marked = np.zeros(found.seen_s.shape, dtype=bool)
        marked[tuple(cells[inside].T)] = True
        return self._distance_of(marked)

    def _distance_of(self, marked: Flags) -> Floats:
        import cv2  # noqa: PLC0415  (`uav-bt check` must answer at once)

        if not marked.any():
            return np.full(marked.shape, math.inf)
        free = (~marked).astype(np.uint8)
        return self.map.cell_m * cv2.distanceTransform(free, cv2.DIST_L2, 5).astype(np.float64)


def new_ground_per_second(new_m2: float, time_s: float) -> float:
    """Return what a leg is worth: the ground that it passes for the first time, in a second."""
    return new_m2 / time_s


def best_leg(
    room: Room, value: Callable[[float, float], float] = new_ground_per_second
) -> Leg | None:
    """Return the leg of the greatest value; None when none is worth it.

    Args:
        room: what can be flown.
        value: of new ground, m2, for a time, s; it falls with time.
    """
    cfg, site_map = room.config, room.map
    time_s = room.fastest.time_s
    worth = room.worth()
    ends = np.zeros(time_s.shape, dtype=bool)
    ends[:: cfg.grid_step, :: cfg.grid_step] = True
    ends &= np.isfinite(time_s)
    ends[room.start] = False
    disc = _disc(cfg.reach_m / site_map.cell_m)
    cell_m2 = site_map.cell_m**2
    best: tuple[float, list[Cell], float, float] | None = None
    # No leg gains more than all there is: what takes too long for that is not tried.
    most_m2 = float(worth.sum()) * cell_m2
    order = np.argwhere(ends)[np.argsort(time_s[ends], kind="stable")]
    for row, column in order:
        end = (int(row), int(column))
        spent_s = float(time_s[end]) + cfg.leg_s
        if best is not None and value(most_m2, spent_s) <= best[0]:
            break
        path = room.fastest.to(end)
        new_m2 = cell_m2 * _new_ground(path, worth, disc, cfg.stamp_step)
        if new_m2 < cfg.least_m2:
            continue
        spent_s += _first_turn_s(path, room)
        worth_of_leg = value(new_m2, spent_s)
        if best is None or worth_of_leg > best[0]:
            best = (worth_of_leg, path, spent_s, new_m2)
    if best is None:
        return None
    _, path, spent_s, new_m2 = best
    return room.leg(path, time_s=spent_s, new_m2=new_m2)


def _new_ground(path: list[Cell], worth: Floats, disc: Flags, step: int) -> float:
    """Return what the ground around a path is worth, in cells."""
    reach = disc.shape[0] // 2
    framed = np.zeros((worth.shape[0] + 2 * reach, worth.shape[1] + 2 * reach), dtype=bool)
    for row, column in {*path[::-step], path[-1]}:
        framed[row : row + disc.shape[0], column : column + disc.shape[1]] |= disc
    return float(worth[framed[reach:-reach, reach:-reach]].sum())


def _first_turn_s(path: list[Cell], room: Room) -> float:
    """Return how long the drone turns before it can fly along a path."""
    ahead = path[min(len(path) - 1, 4)]
    azimuth = math.atan2(ahead[1] - path[0][1], ahead[0] - path[0][0])
    turn_rad = abs(math.remainder(azimuth - room.map.pose.yaw_rad, 2.0 * math.pi))
    return turn_rad / room.config.yaw_rate_radps


def _disc(radius_cells: float) -> Flags:
    reach = int(radius_cells)
    down, right = np.mgrid[-reach : reach + 1, -reach : reach + 1]
    return np.asarray(np.hypot(down, right) <= radius_cells)
