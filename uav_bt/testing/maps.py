"""Site maps drawn by a test: ground, walls, obstacles and the pose of the drone."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from uav_bt.errors import ShapeError, ValueRangeError
from uav_bt.lab.shipped import load_lab
from uav_bt.types import Pose2D
from uav_bt.types.arrays import Flags, Floats
from uav_bt.types.site_map import SiteMap

Wall = tuple[tuple[float, float], tuple[float, float]]
"""A wall: its two ends, x and y in metres in the frame of the map."""

_CELL_M: Final = 0.1  # of a flight's map
_AROUND_M: Final = 1.0  # of the grid beyond the ground; chosen
_STEP_M: Final = 0.05  # between two points of a wall; chosen


def drawn_map(
    *,
    ground_m: float = 4.0,
    walls: Sequence[Wall] = (),
    obstacles: Floats | None = None,
    pose: tuple[float, float, float] = (0.0, 0.0, 0.0),
    known: Flags | None = None,
    passed: Flags | None = None,
) -> SiteMap:
    """Return the map of a square of ground around the origin; beyond it is the outside.

        site_map = drawn_map(walls=[((0.8, -2.0), (0.8, 2.0))], pose=(-1.0, 0.0, 0.0))

    The frame is that of a `SiteMap`: the take-off pose is the origin, x ahead of it, y to its
    right. Objects, mark and movers are added with `dataclasses.replace`.

    Args:
        ground_m: side of the ground.
        walls: obstacles along straight lines.
        obstacles: (N, 2) further points of obstacles, m.
        pose: x and y of the drone, m, and its heading, rad, from x towards y.
        known: cells in which ground was seen. Default: all of the ground. Grids have cells of
            0.1 m and reach 1 m beyond the ground; `drawn_map().places_m()` has the places of the
            cells.
        passed: cells near the flown path. Default: none.
    """
    if not 0.0 < ground_m < math.inf:
        raise ValueRangeError(f"ground_m must be positive, got {ground_m}")
    half = round((ground_m / 2 + _AROUND_M) / _CELL_M)
    places = (np.moveaxis(np.indices((2 * half + 1, 2 * half + 1)), 0, -1) - half) * _CELL_M
    ground = np.abs(places).max(axis=-1) <= ground_m / 2 + 1e-9
    for name, grid in (("known", known), ("passed", passed)):
        if grid is not None and grid.shape != ground.shape:
            raise ShapeError(name, expected=str(ground.shape), actual=grid.shape)
    given = np.empty((0, 2)) if obstacles is None else obstacles
    if given.ndim != 2 or given.shape[1] != 2:
        raise ShapeError("obstacles", expected="(N, 2)", actual=given.shape)
    seen = ground if known is None else ground & known
    return SiteMap(
        classes=load_lab().classes,
        pose=Pose2D(x_m=pose[0], y_m=pose[1], yaw_rad=pose[2]),
        corner_m=(-half * _CELL_M, -half * _CELL_M),
        cell_m=_CELL_M,
        seen_s=np.where(seen, 1.0, -math.inf),
        free=seen,
        outside=~ground,
        passed=np.zeros_like(ground) if passed is None else passed,
        obstacles_m=np.vstack([given, *(_points(wall) for wall in walls)]),
        edges_m=np.empty((0, 2)),
        captured_s=1.0,
    )


def _points(wall: Wall) -> Floats:
    """Return points of a wall, (N, 2)."""
    count = max(2, math.ceil(math.dist(*wall) / _STEP_M) + 1)
    return np.linspace(*wall, count)
