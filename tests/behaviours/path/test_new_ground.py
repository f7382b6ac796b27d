"""New ground along all fastest paths at once, against the union of discs along each path."""

from __future__ import annotations

import numpy as np
import pytest

from behaviours.path.fastest import fastest_paths
from behaviours.path.new_ground import passed_for_the_first_time

RADIUS = 5.0
SHAPE = (40, 30)
START = (20, 15)


def union(path: list[tuple[int, int]], worth: np.ndarray) -> float:
    """Return what all cells are worth that are as near to the path as the radius."""
    rows, columns = np.indices(worth.shape)
    near = np.zeros(worth.shape, dtype=bool)
    for row, column in path:
        near |= np.hypot(rows - row, columns - column) <= RADIUS
    return float(worth[near].sum())


def test_it_is_the_union_of_the_discs_along_the_path() -> None:
    rng = np.random.default_rng(4)
    worth = rng.random(SHAPE)
    open_ = np.ones(SHAPE, dtype=bool)
    open_[10:14, 5:25] = False
    paths = fastest_paths(open_, np.ones(SHAPE), START)
    passed = passed_for_the_first_time(paths, worth, RADIUS)
    for end in [(0, 0), (39, 29), (20, 16), (9, 15), (21, 2)]:
        assert passed[end] == pytest.approx(union(paths.to(end), worth), rel=0.08)
    assert passed[20, 29] == pytest.approx(union(paths.to((20, 29)), worth))  # straight
    assert passed[START] == pytest.approx(union([START], worth))
    assert passed[11, 10] == 0.0


def test_a_straight_path_adds_a_crescent_per_step() -> None:
    paths = fastest_paths(np.ones((1, 12), dtype=bool), np.ones((1, 12)), (0, 3))
    passed = passed_for_the_first_time(paths, np.arange(12.0)[None], 2.0)
    # Around the start the cells 1 to 5; each step adds the cell two ahead of its end.
    assert passed[0].tolist() == [15, 15, 15, 15, 21, 28, 36, 45, 55, 66, 66, 66]
