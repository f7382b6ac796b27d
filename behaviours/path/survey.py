"""Coverage planner: the route that covers the most new ground per second.

A next-best-view planner (Connolly, 1985; Bircher et al., 2016) over the site map. It finds the
fastest path to every known free place, at speeds that the clearance allows. Along each path it
counts the ground within half a metre that is not covered yet. Unseen cells beside known ground also
count, because they may be ground. The numbers were chosen in surveys of the training scenes.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from behaviours.path.clearance import ClearanceMap, Route
from behaviours.path.margins import YAW_RATE_RADPS
from uav_bt.types.arrays import Floats

_REACH_M: Final = 0.5  # m; ground this near to the path counts as covered, as for `CoveredGround`
_UNSEEN_WORTH: Final = 0.5  # of an unseen cell beside known ground; a ground cell is worth 1
_LEG_S: Final = 1.0  # s; time lost at the end of each route
_MIN_LEG_M2: Final = 0.06  # m2; least new ground that makes a route worth flying
_AHEAD_CELLS: Final = 4  # cells along a path to the point that the first turn faces


def best_route(clearance: ClearanceMap) -> Route | None:
    """Return the route that covers the most new ground per second; None if none is worth it."""
    cell_m, paths = clearance.map.cell_m, clearance.fastest
    reached = paths.reached
    new_m2 = cell_m**2 * paths.covered(_worth(clearance), _REACH_M / cell_m).reshape(-1)[reached]
    spent_s = paths.time_s.reshape(-1)[reached] + _LEG_S + _first_turns_s(clearance)
    # A route may begin with less clearance around the drone, but must end with enough.
    roomy = clearance.roomy.reshape(-1)[reached]
    moves = paths.before.reshape(-1)[reached] >= 0
    worth_it = roomy & (new_m2 >= _MIN_LEG_M2) & moves
    if not worth_it.any():
        return None
    best = int(np.where(worth_it, new_m2 / spent_s, -math.inf).argmax())
    row, column = divmod(int(reached[best]), paths.time_s.shape[1])
    path = paths.to((row, column))
    return clearance.route_along(path, time_s=float(spent_s[best]), new_m2=float(new_m2[best]))


def _worth(clearance: ClearanceMap) -> Floats:
    """Return the worth of covering each cell: known or possible ground not covered yet."""
    import cv2  # noqa: PLC0415  (`uav-bt check` must answer at once)

    found = clearance.map
    standing = clearance.obstacle_m < 1.5 * found.cell_m
    ground = found.ground & ~found.outside
    square = np.ones((5, 5), np.uint8)
    near = cv2.dilate(ground.view(np.uint8), square, borderValue=0).view(np.bool_)
    unseen = near & ~(ground | found.outside | standing | found.free)
    worth = np.where(ground & ~standing, 1.0, _UNSEEN_WORTH * unseen)
    return np.where(found.passed, 0.0, worth)


def _first_turns_s(clearance: ClearanceMap) -> Floats:
    """Return the time of the first turn on the path to each reached cell, seconds."""
    steps = np.arange(-_AHEAD_CELLS, _AHEAD_CELLS + 1)
    azimuth = np.arctan2(steps, steps[:, None])  # of the cells around the start
    turn_rad = np.abs(np.angle(np.exp(1j * (azimuth - clearance.map.pose.yaw_rad))))
    rows, columns = clearance.fastest.after(_AHEAD_CELLS)
    row, column = clearance.start
    turn_rad = turn_rad[rows - row + _AHEAD_CELLS, columns - column + _AHEAD_CELLS]
    return np.asarray(turn_rad / YAW_RATE_RADPS)
