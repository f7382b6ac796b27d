"""The cheapest path to the helipad round what is remembered, and keeping to it between ticks.

A metre costs more the nearer an obstacle stands or the carpet ends, and no path leads where the
body would touch. Where an obstacle is only assumed a path costs more but is not closed: on
the approach it is seen from nearer before it is flown.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from behaviours.path.grid import Floats, Grid, costs_to_go, descent
from behaviours.path.straight_edges import EdgeConfig, straight_edges
from uav_bt.errors import ValueRangeError
from uav_bt.types import DroneState, HelipadFix, ObstaclePoints, rotate_points


@dataclass(frozen=True, kw_only=True)
class PathConfig:
    """How near to obstacles a path may pass, and what that costs.

    Distances are from the body's centre: half of its diagonal is 0.2 m, and the memory errs by a
    decimetre. Costs are of a metre, in metres: the length of a detour that is as good.
    """

    cell_m: float = 0.1  # of the grid
    margin_m: float = 1.5  # of the grid around drone and goal, for paths round
    wide_m: float = 0.60  # further away obstacles cost nothing
    narrow_cost: float = 3.0  # at the smallest distance; in proportion in between
    min_m: float = 0.36  # smallest distance
    tight_cost: float = 20.0  # nearer than the smallest: only where there is no other path
    touch_m: float = 0.24  # no path leads nearer
    doubt_cost: float = 6.0  # nearer than the smallest to where an obstacle is assumed
    edge_m: float = 0.3
    edge_cost: float = 5.0  # nearer than that to the carpet's edge
    end_m: float = 0.12  # no path leads nearer to the edge
    # The drone may already be nearer to something than a path may pass, and so may the goal.
    free_start_m: float = 0.25
    free_goal_m: float = 0.35
    hysteresis_m: float = 0.4  # a path may cost so much more than another before it is given up
    ahead_m: float = 0.3  # on the path being flown; further on it may turn
    straight_slack: float = 1.02  # the last cells of a straight line are rounded
    direction_cells: int = 3  # show a path's direction where no straight line cuts it short
    edges: EdgeConfig = field(default_factory=EdgeConfig)  # of the carpet

    def __post_init__(self) -> None:
        lengths = (self.cell_m, self.margin_m, self.wide_m, self.min_m, self.touch_m, self.ahead_m)
        if not min(lengths) > 0.0 or not self.touch_m <= self.min_m < self.wide_m:
            raise ValueRangeError(
                f"distances must be positive and in order (touch_m <= min_m < wide_m), got {self}"
            )


@dataclass(frozen=True, kw_only=True)
class PathToPadConfig:
    """When a path is planned at all, and how often."""

    straight_margin_m: float = 0.52  # flown straight where it is this wide, half, from the centre
    before_pad_m: float = 0.35  # what stands this much before the pad's centre is not on the path
    replan_s: float = 0.2  # a path is planned afresh this often,
    turned_rad: float = math.radians(12)  # but not before the drone has turned to it,
    replan_turning_s: float = 1.5  # or so long has passed
    path: PathConfig = field(default_factory=PathConfig)


class PathToPad:
    """Plans the path, and keeps to it while it is as good as another.

    Args:
        config: when and how it is planned.
    """

    def __init__(self, config: PathToPadConfig | None = None) -> None:
        self._config = config or PathToPadConfig()
        self.drop()

    def drop(self) -> None:
        """Forget the path being flown."""
        self._yaw_rad: float | None = None
        self._planned_s = -math.inf

    def bearing(
        self, obstacles: ObstaclePoints, fix: HelipadFix, state: DroneState, now_s: float
    ) -> float | None:
        """Return the bearing to fly on, None without a path.

        Args:
            obstacles: what is remembered.
            fix: where the pad lies.
            state: of the drone.
            now_s: the mission clock's time.

        Returns:
            Radians from the heading, clockwise positive.
        """
        cfg = self._config
        share = max(fix.range_m - cfg.before_pad_m, 0.0) / max(fix.range_m, cfg.before_pad_m)
        straight = (share * fix.forward_m, share * fix.right_m)
        if obstacles.allows(*straight, margin_m=cfg.straight_margin_m):
            self.drop()
            return fix.bearing_rad
        yaw_rad, present_rad = state.attitude.yaw_rad, None
        if self._yaw_rad is not None:
            present_rad = math.remainder(self._yaw_rad - yaw_rad, 2.0 * math.pi)
            turned = abs(present_rad) < cfg.turned_rad
            if now_s - self._planned_s < (cfg.replan_s if turned else cfg.replan_turning_s):
                return present_rad
        bearing_rad = first_segment(
            obstacles,
            (fix.forward_m, fix.right_m),
            cfg.path,
            yaw_rad=yaw_rad,
            present_rad=present_rad,
        )
        self._planned_s = now_s
        self._yaw_rad = None if bearing_rad is None else yaw_rad + bearing_rad
        return bearing_rad


def first_segment(
    known: ObstaclePoints,
    goal_m: tuple[float, float],
    config: PathConfig,
    *,
    yaw_rad: float = 0.0,
    present_rad: float | None = None,
) -> float | None:
    """Return the bearing of the path's first straight segment, or None without a path.

    Args:
        known: what stands around, and where the carpet ends.
        goal_m: forward and right of the body's centre.
        config: what a path costs.
        yaw_rad: of the drone.
        present_rad: the bearing of the path being flown, if one is; it is kept unless another is
            clearly better.

    Returns:
        Radians from the heading, clockwise positive, within a half turn.
    """
    there_m = rotate_points(np.array([goal_m]), yaw_rad)[0]
    grid = Grid.around(there_m, margin_m=config.margin_m, cell_m=config.cell_m)
    start, goal = grid.cell(np.zeros(2)), grid.cell(there_m)
    if start == goal:
        return math.atan2(goal_m[1], goal_m[0])
    costs = _costs(known, there_m, grid, config, yaw_rad)
    to_go = costs_to_go(config.cell_m * costs, goal)
    if not math.isfinite(to_go[start]):
        return None
    path, slack_m = descent(to_go, start), 0.0
    if present_rad is not None:
        azimuth_rad = present_rad + yaw_rad
        ahead = grid.cell(config.ahead_m * np.array([math.cos(azimuth_rad), math.sin(azimuth_rad)]))
        if to_go[ahead] + config.ahead_m <= to_go[start] + config.hysteresis_m:
            path = np.vstack([path[:1], descent(to_go, ahead)])
            slack_m = config.hysteresis_m
    azimuth_rad = _azimuth(path, costs, to_go, config, slack_m)
    return math.remainder(azimuth_rad - yaw_rad, 2.0 * math.pi)


def _costs(
    known: ObstaclePoints, goal_m: Floats, grid: Grid, config: PathConfig, yaw_rad: float
) -> Floats:
    """Return what a metre costs in each cell; inf where no path leads."""
    clear_m = grid.clearance_m(rotate_points(known.points_m, yaw_rad))
    inside_m = _inside_m(grid, rotate_points(known.edges_m, yaw_rad), config.edges)
    doubt_m = grid.clearance_m(rotate_points(known.assumed_m, yaw_rad))
    narrowness = (config.wide_m - clear_m) / (config.wide_m - config.min_m)
    tightness = np.clip(1.0 - clear_m / config.min_m, 0.0, None)
    cost = 1.0 + config.narrow_cost * np.clip(narrowness, 0.0, 1.0)
    # Within what is too near, outwards is cheaper.
    cost += config.tight_cost * ((tightness > 0.0) + 2.0 * tightness)
    cost += config.doubt_cost * (doubt_m < config.min_m)
    cost += config.edge_cost * (inside_m < config.edge_m)
    closed = (clear_m < config.touch_m) | (inside_m < config.end_m)
    places_m = grid.places_m()
    exempt = np.linalg.norm(places_m, axis=-1) <= config.free_start_m
    exempt |= np.linalg.norm(places_m - goal_m, axis=-1) <= config.free_goal_m
    return np.where(closed & ~exempt, np.inf, cost)


def _inside_m(grid: Grid, edges_m: Floats, config: EdgeConfig) -> Floats:
    """Return how far within the carpet each cell lies, negative beyond a straight edge of it."""
    inside_m = grid.clearance_m(edges_m)
    places_m = grid.places_m()
    for normal, range_m in straight_edges(edges_m, config):
        inside_m = np.minimum(inside_m, range_m - places_m @ normal)
    return inside_m


def _azimuth(
    path: NDArray[np.intp],
    costs: Floats,
    to_go: Floats,
    config: PathConfig,
    slack_m: float,
) -> float:
    """Return the azimuth of the furthest cell of the path that is reached straight as cheaply.

    A path over the grid goes by eighths of a turn, and only for that
    costs more than a straight one.
    """
    start = path[0]
    for cell in path[:0:-1]:
        straight_m = _straight_cost(start, cell, costs) * config.cell_m
        if straight_m <= (_at(to_go, start) - _at(to_go, cell)) * config.straight_slack + slack_m:
            break
    else:
        cell = path[min(config.direction_cells, len(path) - 1)]
    return math.atan2(cell[1] - start[1], cell[0] - start[0])


def _straight_cost(start: NDArray[np.intp], end: NDArray[np.intp], costs: Floats) -> float:
    """Return what the straight line between two cells costs, in cells."""
    apart = end - start
    count = 2 * int(np.abs(apart).max())
    along = start + np.linspace(0.0, 1.0, count + 1)[:, None] * apart
    passed = costs[tuple(np.rint(along).astype(int).T)]
    return float(np.hypot(*apart) * passed.mean())


def _at(values: Floats, cell: NDArray[np.intp]) -> float:
    row, column = cell
    return float(values[row, column])
