"""The map's grid: what happens at its end."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from perception.mapping.contact_scan import GroundScan, find_bases
from perception.mapping.ground_grid import CELL_M, PASSED_M, REACH_M, GroundGrid
from perception.mapping.view import View
from tests.paper_lab import paper_map
from tests.worlds import values
from uav_bt.lab.classes import GROUND, NO_ROLE, OUTSIDE
from uav_bt.testing import pinhole
from uav_bt.types import Pose2D

CAMERA = replace(pinhole(224, 112), forward_offset_m=0.0)
MIDDLE = round(REACH_M / CELL_M)


def see(
    grid: GroundGrid,
    roles: list[list[int]],
    ahead_m: list[float],
    pose: tuple[float, float, float] = (0.0, 0.0, 0.0),
    captured_s: float = 1.0,
) -> None:
    """Add samples at distances ahead of a camera, on one or several bearings."""
    level_m = np.zeros((len(roles), len(ahead_m), 2))
    level_m[..., 0] = ahead_m
    ids = np.array(roles, dtype=np.uint8)
    scan = GroundScan(level_m, ids, ids, 1.5, min_run=1)
    x_m, y_m, yaw_rad = pose
    where = Pose2D(x_m=x_m, y_m=y_m, yaw_rad=yaw_rad)
    frame = values.frame((4, 8), -0.7, captured_s=captured_s)
    view = View.of(paper_map(np.zeros((112, 224), np.uint8), captured_s), frame, CAMERA, where)
    grid.add(replace(view, scan=scan, contacts=find_bases(scan)))


def cells(flags: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return the set cells, counted from the take-off point."""
    return [(int(row) - MIDDLE, int(column) - MIDDLE) for row, column in np.argwhere(flags)]


@pytest.mark.parametrize(
    ("x_m", "y_m", "full"),
    [(11.9, 0.0, False), (-12.0, -12.0, False), (0.0, 11.7, False), (-15.0, 0.0, True)],
)
def test_ground_to_the_end_of_the_grid_is_passed(*, x_m: float, y_m: float, full: bool) -> None:
    grid = GroundGrid()
    grid.fly_over(x_m, y_m)
    places = (np.moveaxis(np.indices(grid.passed.shape), 0, -1) - MIDDLE) * CELL_M
    off_m = np.hypot(*np.moveaxis(places - (x_m, y_m), -1, 0))
    assert grid.passed[off_m <= PASSED_M - 0.05].all()
    assert not grid.passed[off_m > 0.56].any()
    assert grid.full is full


def test_only_ground_beyond_the_grid_makes_it_full() -> None:
    for role, full in ((OUTSIDE, False), (GROUND, True)):
        grid = GroundGrid()
        see(grid, [[role]], [0.9], (11.5, 0.0, 0.0))
        assert grid.full is full
        assert not np.isfinite(grid.seen_s).any()


@pytest.mark.parametrize("epoch_s", [0.0, 1.76e9])
def test_times_are_distinguished_by_any_clock(epoch_s: float) -> None:
    """A drone's clock may count from 1970. 0.5 s after the last look a lane is one, 0.3 s not."""
    grid, place_m = GroundGrid(), np.array([[0.9, 0.0]])
    grid.note_moving(place_m, epoch_s)
    see(grid, [[GROUND]], [0.9], captured_s=epoch_s)
    assert grid.shown_at(place_m, epoch_s).all()
    assert not grid.shown_at(place_m, epoch_s + 0.1).any()

    def is_lane(now_s: float) -> bool:
        return bool((np.hypot(*(grid.lanes_m(now_s) - place_m).T) < 0.05).any())

    assert is_lane(epoch_s + 0.5)
    assert not is_lane(epoch_s + 0.3)


def test_cells_are_ground_by_the_majority_of_samples_and_beyond_by_votes() -> None:
    """Three bearings from (1, 0) with the heading along y; cells have a side of 0.1 m."""
    grid = GroundGrid()
    ground, beyond, below = GROUND, OUTSIDE, NO_ROLE
    roles = [
        [below, ground, ground, ground],
        [below, ground, beyond, beyond],
        [below, beyond, ground, beyond],
    ]
    # The second and the third lie in one cell.
    see(grid, roles, [0.1, 0.5, 0.51, 0.7], (1.0, 0.0, math.pi / 2), captured_s=2.0)
    assert cells(np.isfinite(grid.seen_s)) == [(10, 5)]  # four of six are ground
    assert grid.seen_s[MIDDLE + 10, MIDDLE + 5] == 2.0
    side = len(grid.seen_s)
    assert cells(grid.outside((slice(0, side), slice(0, side)))) == [(10, 7)]
    # On the first bearing: 0.08 m to 0.48 m, steps of 0.08 m, are nearer than 0.5 m.
    assert cells(grid.free) == [(10, column) for column in range(1, 6)]
    rows, columns = grid.window()  # with six cells around
    assert (rows.start, rows.stop) == (MIDDLE - 6, MIDDLE + 17)
    assert (columns.start, columns.stop) == (MIDDLE - 6, MIDDLE + 14)
    assert grid.corner_m((rows, columns)) == pytest.approx((-0.6, -0.6))
