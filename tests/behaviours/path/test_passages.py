"""The way out of a corner, through a gap that the other passages close behind the drone."""

from __future__ import annotations

import math

import numpy as np
import pytest

from behaviours.path.margins import Margins, Passage
from behaviours.path.nearby import RecentObstacles
from behaviours.path.passages import ClearanceMaps
from uav_bt.testing.world import drawn_map
from uav_bt.types.site_map import SiteMap

CORNER = (-1.6, 1.4)
MARK = (0.5, -1.0)


def corner(gap_m: float, *, at: tuple[float, float] = CORNER) -> SiteMap:
    """Return a map whose wall leaves a corner, and a gap between the wall's end and the edge.

    Args:
        gap_m: Width of the gap, from the wall to the first cell of the outside.
        at: Place of the drone.
    """
    ends_m = -2.1 + gap_m
    across = [(x_m, 0.5) for x_m in np.arange(ends_m, -1.05, 0.1)]
    along = [(-1.1, y_m) for y_m in np.arange(0.5, 2.05, 0.1)]
    return drawn_map(obstacles=np.array(across + along), pose=(*at, math.pi / 2))


def maps_of(site_map: SiteMap, *, over: tuple[float, float] | None = None) -> ClearanceMaps:
    return ClearanceMaps(site_map, RecentObstacles(), Margins(), crossing=True, over=over)


@pytest.mark.parametrize("over", [None, MARK], ids=["to the place", "over the mark"])
def test_a_drone_in_a_corner_flies_out_by_the_gap_beside_the_edge(
    over: tuple[float, float] | None,
) -> None:
    """0.2 m from the edge and 0.3 m from the wall, which a route may begin with as well."""
    maps = maps_of(corner(0.5), over=over)
    assert maps[Passage.TIGHTEST].shut_in
    route = maps.route_to(MARK, near_m=0.15, far_m=0.15)
    assert route is not None
    assert route.margins == maps[Passage.OUT].margins
    assert maps_of(corner(0.4), over=over).route_to(MARK, near_m=0.15, far_m=0.15) is None


def test_the_clearance_of_the_drones_own_cell_does_not_decide_whether_it_gets_out() -> None:
    """A drone that sways towards the edge and back sees the same way out."""
    for x_m in (-1.9, -1.8, -1.7, -1.6, -1.5):
        found = maps_of(corner(0.5, at=(x_m, 1.0))).route_to(MARK, near_m=0.15, far_m=0.15)
        assert found is not None


def test_nobody_flies_into_the_corner_by_that_gap() -> None:
    maps = maps_of(corner(0.5, at=MARK))
    assert list(maps.usable()) == [Passage.ORDINARY, Passage.TIGHT, Passage.TIGHTEST]
    assert maps.route_to(CORNER, near_m=0.15, far_m=0.15) is None
