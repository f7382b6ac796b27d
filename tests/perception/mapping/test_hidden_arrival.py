"""Obstacles that have arrived with their base below the view."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from perception.mapping.ground_grid import GroundGrid
from perception.mapping.hidden_arrival import HiddenArrivalConfig, hidden_arrival
from uav_bt.types import Pose2D

CONFIG = HiddenArrivalConfig(from_m=0.4, to_m=1.1, beside_m=0.3, bearings=3)
HERE = Pose2D(x_m=1.0, y_m=-0.5, yaw_rad=math.radians(90))
NOTHING = np.empty((0, 2))


def seen_ground() -> GroundGrid:
    grid = GroundGrid()
    grid.seen_s[:] = 1.0
    return grid


def hidden(*bearings_deg: float, range_m: float = 1.3) -> NDArray[np.float64]:
    """Return the nearest ground in view on bearings from the heading."""
    bearings = np.radians(bearings_deg)
    return range_m * np.stack([np.cos(bearings), np.sin(bearings)], axis=-1)


def test_what_covers_ground_that_was_free_has_arrived() -> None:
    """The direction is that of the middle bearing, in the map's frame."""
    ahead = hidden_arrival(hidden(29, 30, 31), HERE, seen_ground(), NOTHING, CONFIG)
    assert ahead is not None
    turned_rad = math.radians(90 + 30)
    assert ahead == pytest.approx([math.cos(turned_rad), math.sin(turned_rad)], abs=1e-6)


@pytest.mark.parametrize("bearings_deg", [(), (30,), (30, 31)])
def test_few_bearings_are_specks(bearings_deg: tuple[float, ...]) -> None:
    found = hidden_arrival(hidden(*bearings_deg), HERE, seen_ground(), NOTHING, CONFIG)
    assert found is None


@pytest.mark.parametrize("unseen_m", [0.5, 1.0])
def test_on_ground_that_was_never_seen_an_obstacle_may_always_have_stood(unseen_m: float) -> None:
    grid = seen_ground()
    row, column = HERE.to_world(unseen_m, 0.0)
    grid.seen_s[round(row / 0.1) + 120, round(column / 0.1) + 120] = -np.inf
    assert hidden_arrival(hidden(-1, 0, 1), HERE, grid, NOTHING, CONFIG) is None


def test_farther_ground_need_not_have_been_seen() -> None:
    grid = seen_ground()
    row, column = HERE.to_world(1.3, 0.0)
    grid.seen_s[round(row / 0.1) + 120, round(column / 0.1) + 120] = -np.inf
    assert hidden_arrival(hidden(-1, 0, 1), HERE, grid, NOTHING, CONFIG) is not None


@pytest.mark.parametrize(("ahead_m", "right_m"), [(0.6, 0.0), (1.3, 0.2), (0.9, -0.25)])
def test_an_obstacle_of_the_map_is_known(ahead_m: float, right_m: float) -> None:
    known_m = np.array([HERE.to_world(ahead_m, right_m)])
    assert hidden_arrival(hidden(-1, 0, 1), HERE, seen_ground(), known_m, CONFIG) is None


def test_an_obstacle_of_the_map_elsewhere_explains_nothing() -> None:
    known_m = np.array([HERE.to_world(0.6, 0.8), HERE.to_world(-0.5, 0.0)])
    assert hidden_arrival(hidden(-1, 0, 1), HERE, seen_ground(), known_m, CONFIG) is not None
