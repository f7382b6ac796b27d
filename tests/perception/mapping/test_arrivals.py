"""Points and hidden obstacles that have arrived on ground seen free before."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from perception.mapping.ground_grid import GroundGrid
from perception.mapping.landmarks import Landmarks
from perception.mapping.movers import find_arrivals, hidden_arrival
from tests.perception.mapping.test_landmarks import points
from uav_bt.types import Pose2D


def landmarks(x_m: float, *, seen_s: float) -> Landmarks:
    """Return one base at a place, settled when it was seen."""
    time_s = np.array([seen_s])
    return replace(points((x_m, 0.0)), first_s=time_s, seen_s=time_s, settled_s=time_s)


@pytest.mark.parametrize(
    ("off_m", "on_ground", "owned", "arrived"),
    [
        (0.05, True, False, False),
        (0.05, True, True, False),  # a mover that passes a box does not take its points along
        (0.2, True, False, True),
        (0.125, True, False, False),
        (0.125, True, True, True),  # between both, the mover owns more
        (0.2, False, False, False),
    ],
)
def test_a_point_near_a_standing_one_has_not_arrived(
    *, off_m: float, on_ground: bool, owned: bool, arrived: bool
) -> None:
    seen, known = landmarks(1.0 + off_m, seen_s=20.0), landmarks(1.0, seen_s=0.0)
    found = find_arrivals(seen, known, np.array([on_ground]), np.array([owned]))
    assert found.tolist() == [arrived]


HERE = Pose2D(x_m=1.0, y_m=-0.5, yaw_rad=math.radians(90))


def hidden(
    *bearings_deg: float,
    unseen: tuple[float, float] | None = None,
    known: tuple[tuple[float, float], ...] = (),
) -> NDArray[np.float64] | None:
    """Return the arrival that hides ground 1.3 m away on bearings.

    All ground but one place was seen; places are metres ahead of `HERE` and to its right.
    """
    bearings, grid = np.radians(bearings_deg), GroundGrid()
    grid.seen_s[:] = 1.0
    if unseen is not None:
        row, column = HERE.to_world(*unseen)
        grid.seen_s[round(row / 0.1) + 120, round(column / 0.1) + 120] = -np.inf
    known_m = np.array([HERE.to_world(*place) for place in known]).reshape(-1, 2)
    ends_m = 1.3 * np.stack([np.cos(bearings), np.sin(bearings)], axis=-1)
    return hidden_arrival(ends_m, HERE, grid, known_m)


def test_what_covers_ground_that_was_free_has_arrived() -> None:
    """The direction is that of the middle bearing, in the map's frame."""
    turned_rad = math.radians(90 + 30)
    expected = [math.cos(turned_rad), math.sin(turned_rad)]
    assert hidden(29, 30, 31) == pytest.approx(np.array(expected), abs=1e-6)
    for bearings_deg in ((), (30,), (30, 31)):  # specks
        assert hidden(*bearings_deg) is None


@pytest.mark.parametrize(("ahead_m", "arrived"), [(0.5, False), (1.0, False), (1.3, True)])
def test_on_ground_that_was_never_seen_an_obstacle_may_always_have_stood(
    *, ahead_m: float, arrived: bool
) -> None:
    """Farther ground need not have been seen."""
    assert (hidden(-1, 0, 1, unseen=(ahead_m, 0.0)) is not None) == arrived


@pytest.mark.parametrize("place", [(0.6, 0.0), (1.3, 0.2), (0.9, -0.25)])
def test_an_obstacle_of_the_map_is_known(place: tuple[float, float]) -> None:
    """One elsewhere explains nothing."""
    assert hidden(-1, 0, 1, known=(place,)) is None
    assert hidden(-1, 0, 1, known=((0.6, 0.8), (-0.5, 0.0))) is not None
