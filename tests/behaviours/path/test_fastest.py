"""Fastest paths against SciPy's search, and the ground along them against the union of discs."""

import itertools
import math

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from behaviours.path.fastest import fastest_paths

RADIUS = 5.0
SHAPE = (40, 30)
START = (20, 15)


def by_scipy(open_: np.ndarray, cell_s: np.ndarray, start: tuple[int, int]) -> np.ndarray:
    """Return the time to each cell; inf where no path leads."""
    height, width = open_.shape
    begins, ends, times_s = [], [], []
    for row, column in np.argwhere(open_):
        for down, right in ((0, 1), (1, 0), (1, 1), (1, -1)):
            there = row + down, column + right
            if there[0] < height and 0 <= there[1] < width and open_[there]:
                begins.append(row * width + column)
                ends.append(there[0] * width + there[1])
                mean_s = (cell_s[row, column] + cell_s[there]) / 2
                times_s.append(math.hypot(down, right) * mean_s)
    graph = coo_array((times_s, (begins, ends)), shape=(open_.size, open_.size)).tocsr()
    time_s = dijkstra(graph, directed=False, indices=start[0] * width + start[1])
    return np.asarray(time_s).reshape(open_.shape)


def test_times_are_those_of_scipy_and_paths_take_them() -> None:
    rng = np.random.default_rng(7)
    for shape, start in (((25, 31), (12, 15)), ((31, 8), (0, 0)), ((1, 9), (0, 8))):
        open_ = rng.random(shape) < 0.7
        open_[start] = True
        cell_s = rng.choice([0.2, 0.25, 0.4], size=shape)  # equal times occur
        paths = fastest_paths(open_, cell_s, start)
        np.testing.assert_array_equal(paths.time_s, by_scipy(open_, cell_s, start))
        assert (np.diff(paths.time_s.reshape(-1)[paths.order]) >= 0.0).all()
        assert sorted(paths.reached) == np.flatnonzero(np.isfinite(paths.time_s)).tolist()
        for cell in map(tuple, np.argwhere(np.isfinite(paths.time_s))):
            path = paths.to(cell)
            assert path[0] == start
            assert path[-1] == cell
            assert all(open_[step] for step in path)
            spent_s = sum(
                math.dist(one, two) * (cell_s[one] + cell_s[two]) / 2
                for one, two in itertools.pairwise(path)
            )
            assert math.isclose(spent_s, paths.time_s[cell], rel_tol=1e-12, abs_tol=1e-12)


def test_on_a_line_the_cells_after_two_steps_and_what_each_step_adds() -> None:
    paths = fastest_paths(np.ones((1, 12), dtype=bool), np.ones((1, 12)), (0, 3))
    rows, columns = paths.after(2)
    assert rows.tolist() == [0] * 12
    assert columns.tolist() == [1, 1, 2, 3, 4, 5, 5, 5, 5, 5, 5, 5]
    # Around the start the cells 1 to 5; each step adds the cell two ahead of its end.
    covered = paths.covered(np.arange(12.0)[None], 2.0)
    assert covered[0].tolist() == [15, 15, 15, 15, 21, 28, 36, 45, 55, 66, 66, 66]


def union(path: list[tuple[int, int]], worth: np.ndarray) -> float:
    """Return what all cells are worth that are as near to the path as the radius."""
    rows, columns = np.indices(worth.shape)
    near = np.zeros(worth.shape, dtype=bool)
    for row, column in path:
        near |= np.hypot(rows - row, columns - column) <= RADIUS
    return float(worth[near].sum())


def test_a_path_covers_the_union_of_the_discs_along_it() -> None:
    worth = np.random.default_rng(4).random(SHAPE)
    open_ = np.ones(SHAPE, dtype=bool)
    open_[10:14, 5:25] = False
    paths = fastest_paths(open_, np.ones(SHAPE), START)
    covered = paths.covered(worth, RADIUS)
    for end in [(0, 0), (39, 29), (20, 16), (9, 15), (21, 2)]:
        assert covered[end] == pytest.approx(union(paths.to(end), worth), rel=0.08)
    assert covered[20, 29] == pytest.approx(union(paths.to((20, 29)), worth))  # straight
    assert covered[START] == pytest.approx(union([START], worth))
    assert covered[11, 10] == 0.0
