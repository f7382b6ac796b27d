"""The grid: cells, clearances, costs to go."""

from __future__ import annotations

import math

import numpy as np
import pytest

from behaviours.path.grid import Grid, costs_to_go, descent

GRID = Grid.around(np.array([1.0, -0.5]), margin_m=0.5, cell_m=0.1)


def test_it_lies_over_drone_and_goal() -> None:
    assert GRID.shape == (21, 16)
    assert GRID.cell(np.zeros(2)) == (5, 10)
    assert GRID.places_m()[GRID.cell(np.array([1.0, -0.5]))] == pytest.approx((1.0, -0.5))
    assert GRID.cell(np.array([9.0, -9.0])) == (20, 0)


def test_clearance_is_the_distance_to_the_nearest_point() -> None:
    clear_m = GRID.clearance_m(np.array([[0.0, 0.0], [50.0, 0.0]]))

    assert clear_m[GRID.cell(np.zeros(2))] == 0.0
    assert clear_m[GRID.cell(np.array([0.5, 0.0]))] == pytest.approx(0.5, abs=0.02)
    assert np.isinf(GRID.clearance_m(np.empty((0, 2)))).all()


def test_costs_to_go_grow_with_the_distance_round_what_is_closed() -> None:
    costs = np.ones((5, 5))
    costs[2, :4] = np.inf

    to_go = costs_to_go(costs, (0, 0))

    assert to_go[0, 4] == pytest.approx(4.0)
    assert to_go[1, 1] == pytest.approx(math.sqrt(2.0))
    assert to_go[4, 0] == pytest.approx(4 * math.sqrt(2.0) + 4.0)
    assert np.isinf(to_go[2, 0])
    way = descent(to_go, (4, 0)).tolist()
    assert way[0] == [4, 0]
    assert way[-1] == [0, 0]
    assert [2, 4] in way
