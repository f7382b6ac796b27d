"""Drawn maps of the tests of the planner and of the leaves that fly by it."""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from uav_bt.testing.world import drawn_map
from uav_bt.types.site_map import MapMover, SiteMap

RING = np.array([(math.cos(a), math.sin(a)) for a in np.linspace(0, 2 * math.pi, 120)])


def where(condition: str) -> NDArray[np.bool_]:
    x, y = np.indices((61, 61)) * 0.1 - 3.0
    return {"left": y < 0.0, "right": y > 0.0, "near": np.hypot(x, y) < 1.2}[condition]


CORNER = (-1.6, 1.4)
MARK = (0.5, -1.0)


def corner(gap_m: float, *, at: tuple[float, float] = CORNER) -> SiteMap:
    """Return a map whose wall leaves a corner, and a gap between the wall's end and the outside."""
    ends_m = -2.1 + gap_m
    across = [(x_m, 0.5) for x_m in np.arange(ends_m, -1.05, 0.1)]
    along = [(-1.1, y_m) for y_m in np.arange(0.5, 2.05, 0.1)]
    return drawn_map(obstacles=np.array(across + along), pose=(*at, math.pi / 2))


def mover(x_m: float, y_m: float, x_mps: float = 0.0, y_mps: float = 0.0) -> MapMover:
    place = {"x_m": x_m, "y_m": y_m, "x_mps": x_mps, "y_mps": y_mps, "radius_m": 0.25}
    return MapMover(id=1, std_m=0.04, std_mps=0.1, first_s=0.0, seen_s=1.0, **place)


def with_movers(*movers: MapMover, **drawn: object) -> SiteMap:
    return replace(drawn_map(**drawn), movers=movers)  # type: ignore[arg-type]
