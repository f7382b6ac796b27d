"""Points and hidden obstacles that have arrived on ground seen free before."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from perception.mapping.ground_grid import GroundGrid
from perception.mapping.landmarks import Landmarks
from perception.mapping.movers import find_arrivals, hidden_arrival
from uav_bt.types import Pose2D


def landmarks(x_m: float, *, seen_s: float) -> Landmarks:
    """Return one base at a place, settled when it was seen."""
    time_s = np.array([seen_s])
    return Landmarks(
        xy_m=np.array([[x_m, 0.0]]),
        weight=np.ones(1),
        first_s=time_s,
        seen_s=time_s,
        settled_s=time_s,
        from_m=np.zeros((1, 2)),
        ids=np.ones(1, dtype=np.uint8),
        missed=np.zeros(1),
    )


@pytest.mark.parametrize("owned", [False, True])
@pytest.mark.parametrize(("off_m", "arrived"), [(0.05, False), (0.2, True)])
def test_a_point_near_a_standing_one_has_not_arrived(
    *, off_m: float, arrived: bool, owned: bool
) -> None:
    """A mover that passes a box does not take the box's points along."""
    seen, known = landmarks(1.0 + off_m, seen_s=20.0), landmarks(1.0, seen_s=0.0)
    ground, owner = np.array([True]), np.array([owned])
    assert find_arrivals(seen, known, ground, owner).tolist() == [arrived]


def test_between_a_mover_and_a_standing_point_the_mover_owns_more() -> None:
    off_m = 0.125
    seen, known = landmarks(1.0 + off_m, seen_s=20.0), landmarks(1.0, seen_s=0.0)
    yes, no = np.array([True]), np.array([False])
    assert find_arrivals(seen, known, yes, yes).all()
    assert not find_arrivals(seen, known, yes, no).any()


# --- hidden obstacles ---

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
    ahead = hidden_arrival(hidden(29, 30, 31), HERE, seen_ground(), NOTHING)
    assert ahead is not None
    turned_rad = math.radians(90 + 30)
    assert ahead == pytest.approx([math.cos(turned_rad), math.sin(turned_rad)], abs=1e-6)


@pytest.mark.parametrize("bearings_deg", [(), (30,), (30, 31)])
def test_few_bearings_are_specks(bearings_deg: tuple[float, ...]) -> None:
    found = hidden_arrival(hidden(*bearings_deg), HERE, seen_ground(), NOTHING)
    assert found is None


@pytest.mark.parametrize("unseen_m", [0.5, 1.0])
def test_on_ground_that_was_never_seen_an_obstacle_may_always_have_stood(unseen_m: float) -> None:
    grid = seen_ground()
    row, column = HERE.to_world(unseen_m, 0.0)
    grid.seen_s[round(row / 0.1) + 120, round(column / 0.1) + 120] = -np.inf
    assert hidden_arrival(hidden(-1, 0, 1), HERE, grid, NOTHING) is None


def test_farther_ground_need_not_have_been_seen() -> None:
    grid = seen_ground()
    row, column = HERE.to_world(1.3, 0.0)
    grid.seen_s[round(row / 0.1) + 120, round(column / 0.1) + 120] = -np.inf
    assert hidden_arrival(hidden(-1, 0, 1), HERE, grid, NOTHING) is not None


@pytest.mark.parametrize(("ahead_m", "right_m"), [(0.6, 0.0), (1.3, 0.2), (0.9, -0.25)])
def test_an_obstacle_of_the_map_is_known(ahead_m: float, right_m: float) -> None:
    known_m = np.array([HERE.to_world(ahead_m, right_m)])
    assert hidden_arrival(hidden(-1, 0, 1), HERE, seen_ground(), known_m) is None


def test_an_obstacle_of_the_map_elsewhere_explains_nothing() -> None:
    known_m = np.array([HERE.to_world(0.6, 0.8), HERE.to_world(-0.5, 0.0)])
    assert hidden_arrival(hidden(-1, 0, 1), HERE, seen_ground(), known_m) is not None
