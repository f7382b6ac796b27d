"""The map's grid: what happens at its end."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from perception.mapping.contact_scan import ContactScanConfig, GroundScan, find_bases
from perception.mapping.ground_grid import GroundGrid, GroundGridConfig
from perception.mapping.view import View, ViewConfig
from tests.paper_lab import CLASSES
from uav_bt.lab.classes import GROUND, NO_ROLE, OUTSIDE
from uav_bt.testing import pinhole
from uav_bt.types import Pose2D

CAMERA = replace(pinhole(224, 112), forward_offset_m=0.0)
SMALL = GroundGridConfig(reach_m=2.0)


def see(
    grid: GroundGrid, role: int, *, ahead_m: float, x_m: float = 0.0, captured_s: float = 1.0
) -> None:
    """Add one sample at a distance ahead of a camera at x."""
    scan = GroundScan(
        roles=np.array([[role]], dtype=np.uint8),
        level_m=np.array([[[ahead_m, 0.0]]]),
        ids=np.array([[0]], dtype=np.uint8),
        image_roles=np.array([[role]], dtype=np.uint8),
        top_of=CLASSES.top_of,
        height_m=1.5,
        config=ContactScanConfig(min_run=1),
    )
    grid.add(
        View(
            captured_s=captured_s,
            pose=Pose2D(x_m=x_m, y_m=0.0, yaw_rad=0.0),
            camera=CAMERA,
            pitch_rad=-0.7,
            height_m=1.5,
            config=ViewConfig(),
            scan=scan,
            contacts=find_bases(scan),
            bases_m=np.empty((0, 2)),
            base_ids=np.empty(0, dtype=np.uint8),
            base_heights_m=np.empty(0),
            edges_m=np.empty((0, 2)),
        )
    )


@pytest.mark.parametrize(("x_m", "y_m"), [(1.9, 0.0), (-2.0, -2.0), (0.0, 1.7)])
def test_ground_at_the_end_of_the_grid_is_passed_too(x_m: float, y_m: float) -> None:
    grid = GroundGrid(SMALL)
    grid.fly_over(x_m, y_m)
    places = (np.moveaxis(np.indices(grid.passed.shape), 0, -1) - 20) * 0.1
    near = np.hypot(*np.moveaxis(places - (x_m, y_m), -1, 0)) <= SMALL.passed_m - 0.05
    assert grid.passed[near].all()
    assert not grid.passed[np.hypot(*np.moveaxis(places - (x_m, y_m), -1, 0)) > 0.56].any()
    assert not grid.full


def test_beyond_the_grid_nothing_is_marked_and_it_is_full() -> None:
    grid = GroundGrid(SMALL)
    grid.fly_over(-5.0, 0.0)
    assert not grid.passed.any()
    assert grid.full


def test_only_ground_beyond_the_grid_makes_it_full() -> None:
    for role, full in ((OUTSIDE, False), (GROUND, True)):
        grid = GroundGrid(SMALL)
        see(grid, role, ahead_m=0.9, x_m=1.5)
        assert grid.full is full
        assert np.isfinite(grid.seen_s).sum() == 0


@pytest.mark.parametrize("epoch_s", [0.0, 1.76e9])
def test_views_a_tenth_of_a_second_apart_are_distinguished_by_any_clock(epoch_s: float) -> None:
    """A drone's clock may count seconds from 1970."""
    grid, place_m = GroundGrid(SMALL), np.array([[0.9, 0.0]])
    see(grid, GROUND, ahead_m=0.9, captured_s=epoch_s)
    assert grid.shown_at(place_m, epoch_s).all()
    assert not grid.shown_at(place_m, epoch_s + 0.1).any()


@pytest.mark.parametrize("epoch_s", [0.0, 1.76e9])
def test_a_lane_is_over_once_the_ground_was_seen_since(epoch_s: float) -> None:
    """0.5 s after the last look it is a lane, 0.3 s after it is not."""
    grid, place_m = GroundGrid(SMALL), np.array([[0.9, 0.0]])
    grid.note_moving(place_m, epoch_s)
    see(grid, GROUND, ahead_m=0.9, captured_s=epoch_s)

    def is_lane(now_s: float) -> bool:
        return bool((np.hypot(*(grid.lanes_m(now_s) - place_m).T) < 0.05).any())

    assert is_lane(epoch_s + 0.5)
    assert not is_lane(epoch_s + 0.3)


def test_cells_are_ground_by_the_majority_of_samples_and_beyond_by_votes() -> None:
    """Three bearings from (1, 0) with the heading along y; cells have a side of 0.1 m."""
    grid = GroundGrid(SMALL)
    ground, beyond, below = GROUND, OUTSIDE, NO_ROLE
    roles = np.array(
        [
            [below, ground, ground, ground],
            [below, ground, beyond, beyond],
            [below, beyond, ground, beyond],
        ],
        dtype=np.uint8,
    )
    ahead_m = np.array([0.1, 0.5, 0.51, 0.7])  # the second and the third lie in one cell
    level_m = np.zeros((3, 4, 2))
    level_m[..., 0] = ahead_m
    scan = GroundScan(
        level_m, roles, roles, roles, CLASSES.top_of, 1.5, ContactScanConfig(min_run=1)
    )
    view = View(
        captured_s=2.0,
        pose=Pose2D(x_m=1.0, y_m=0.0, yaw_rad=math.pi / 2),
        camera=CAMERA,
        pitch_rad=-0.7,
        height_m=1.5,
        config=ViewConfig(),
        scan=scan,
        contacts=find_bases(scan),
        bases_m=np.empty((0, 2)),
        base_ids=np.empty(0, dtype=np.uint8),
        base_heights_m=np.empty(0),
        edges_m=np.empty((0, 2)),
    )
    grid.add(view)
    # Rows along x: 1.0 m is row 30. Columns along y: 0.5 m is column 25, 0.7 m is column 27.
    assert np.argwhere(np.isfinite(grid.seen_s)).tolist() == [[30, 25]]  # four of six are ground
    assert grid.seen_s[30, 25] == 2.0
    assert np.argwhere(grid.outside((slice(0, 41), slice(0, 41)))).tolist() == [[30, 27]]
    # On the first bearing: 0.08 m to 0.48 m, steps of 0.08 m, are nearer than 0.5 m.
    assert np.argwhere(grid.free).tolist() == [[30, column] for column in range(21, 26)]
    window = grid.window(margin=0)
    assert window == (slice(20, 31), slice(20, 28))
