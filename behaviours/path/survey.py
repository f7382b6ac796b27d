"""Coverage planner: the route that covers the most new ground per second.

A next-best-view planner (Connolly, 1985; Bircher et al., 2016) over the site map. It finds the
fastest path to every known free place, at speeds that the clearance allows. Along each path it
counts the ground within half a metre that is not covered yet. Unseen cells beside known ground also
count, because they may be ground.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from behaviours.path.clearance import ClearanceMap, Route
from behaviours.path.new_ground import passed_for_the_first_time
from uav_bt.types.arrays import Floats

_AHEAD_CELLS: Final = 4  # cells along a path to the point that the first turn faces


@dataclass(frozen=True, kw_only=True)
class SurveyConfig:
    """The worth of routes. The numbers were chosen in surveys of the training scenes.

    Attributes:
        reach_m: Ground within this distance of the path counts as covered, as for `CoveredGround`.
        unseen_worth: Worth of an unseen cell beside known ground; a ground cell is worth 1.
        yaw_rate_radps: Rate of the first turn.
        leg_s: Time lost at the end of each route.
        min_leg_m2: Least new ground that makes a route worth flying.
    """

    reach_m: float = 0.5
    unseen_worth: float = 0.5
    yaw_rate_radps: float = 0.8
    leg_s: float = 1.0
    min_leg_m2: float = 0.06


def best_route(clearance: ClearanceMap, config: SurveyConfig | None = None) -> Route | None:
    """Return the route that covers the most new ground per second; None if none is worth it.

    Args:
        clearance: The clearance map.
        config: The worth of ground.
    """
    cfg, cell_m, paths = config or SurveyConfig(), clearance.map.cell_m, clearance.fastest
    passed = passed_for_the_first_time(
        paths, _worth(clearance, cfg.unseen_worth), cfg.reach_m / cell_m
    )
    new_m2 = cell_m**2 * passed.reshape(-1)[paths.reached]
    spent_s = (
        paths.time_s.reshape(-1)[paths.reached]
        + cfg.leg_s
        + _first_turns_s(clearance, cfg.yaw_rate_radps)
    )
    # A route may begin with less clearance around the drone, but must end with enough.
    roomy = clearance.roomy.reshape(-1)[paths.reached]
    moves = paths.before.reshape(-1)[paths.reached] >= 0
    worth_it = roomy & (new_m2 >= cfg.min_leg_m2) & moves
    if not worth_it.any():
        return None
    best = int(np.where(worth_it, new_m2 / spent_s, -math.inf).argmax())
    row, column = divmod(int(paths.reached[best]), paths.time_s.shape[1])
    path = paths.to((row, column))
    return clearance.route_along(path, time_s=float(spent_s[best]), new_m2=float(new_m2[best]))


def _worth(clearance: ClearanceMap, unseen_worth: float) -> Floats:
    """Return the worth of covering each cell: known or possible ground not covered yet."""
    import cv2  # noqa: PLC0415  (`uav-bt check` must answer at once)

    found = clearance.map
    standing = clearance.obstacle_m < 1.5 * found.cell_m
    ground = found.ground & ~found.outside
    near = cv2.dilate(ground.astype(np.uint8), np.ones((5, 5), np.uint8), borderValue=0).astype(
        bool
    )
    unseen = near & ~ground & ~found.outside & ~standing & ~found.free
    worth = np.where(ground & ~standing, 1.0, 0.0) + unseen_worth * unseen
    return np.asarray(np.where(found.passed, 0.0, worth))


def _first_turns_s(clearance: ClearanceMap, yaw_rate_radps: float) -> Floats:
    """Return the time of the first turn on the path to each reached cell, seconds."""
    steps = np.arange(-_AHEAD_CELLS, _AHEAD_CELLS + 1)
    azimuth = np.arctan2(steps, steps[:, None])  # of the cells around the start
    turn_rad = np.abs(np.angle(np.exp(1j * (azimuth - clearance.map.pose.yaw_rad))))
    rows, columns = clearance.fastest.after(_AHEAD_CELLS)
    start_row, start_column = clearance.start
    turn_rad = turn_rad[rows - start_row + _AHEAD_CELLS, columns - start_column + _AHEAD_CELLS]
    return np.asarray(turn_rad / yaw_rate_radps)
