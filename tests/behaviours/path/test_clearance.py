"""Clearance on drawn maps: distances, points nearby, fastest paths."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from behaviours.path.clearance import ClearanceMap, Distances
from behaviours.path.compiled_loops import has_near
from behaviours.path.fastest import fastest_paths
from behaviours.path.margins import Margins
from behaviours.path.nearby import RecentObstacles
from tests.behaviours.path.drawn_maps import RING
from uav_bt.testing.world import drawn_map
from uav_bt.types.site_map import MapObject, SiteMap

ORIGIN = 30, 30  # the cell at (0, 0)
X, Y = np.indices((61, 61)) * 0.1 - 3.0
NONE = RecentObstacles()


def clearance(site_map: SiteMap) -> ClearanceMap:
    return ClearanceMap(site_map, NONE)


def test_the_nearest_of_mapped_and_recent_obstacles_counts() -> None:
    site_map = drawn_map(obstacles=np.array([[1.0, 0.0]]))
    assert Distances(site_map, NONE).obstacle_m[ORIGIN] == pytest.approx(1.0)
    recent = RecentObstacles(seen_m=np.array([[0.0, -0.4]]))
    assert Distances(site_map, recent).obstacle_m[ORIGIN] == pytest.approx(0.4)
    assert Distances(drawn_map(), NONE).obstacle_m[ORIGIN] == math.inf


def test_an_object_is_solid_on_all_sides() -> None:
    box = MapObject(class_id=1, x_m=0.0, y_m=1.0, size_m=0.6, width_m=0.6, std_m=0.0, seen_s=1.0)
    found = Distances(replace(drawn_map(), objects=(box,)), NONE)
    assert (found.obstacle_m[28:33, 38:43] == 0.0).all()  # up to 0.25 m from its middle
    assert found.obstacle_m[30, 35] > 0.0
    turned = replace(box, size_m=0.8, width_m=0.4, yaw_rad=math.pi / 2)
    found = Distances(replace(drawn_map(), objects=(turned,)), NONE)
    for row, column, distance_m in ((30, 30, 0.6), (30, 50, 0.6), (40, 40, 0.8), (30, 40, 0.0)):
        assert found.obstacle_m[row, column] == pytest.approx(distance_m, abs=0.11)


def test_the_outside_and_edge_points_are_edges() -> None:
    # The ground ends 2 m from the origin, so the first outside cell is 2.1 m away.
    assert Distances(drawn_map(), NONE).edge_m[ORIGIN] == pytest.approx(2.1)
    recent = RecentObstacles(edges_m=np.array([[0.0, 1.5], [50.0, 50.0]]))
    assert Distances(drawn_map(), recent).edge_m[ORIGIN] == pytest.approx(1.5)
    ahead = RecentObstacles(edges_m=np.array([[0.6, y_m] for y_m in np.arange(-0.5, 0.55, 0.05)]))
    beside = drawn_map().cell_of(0.5, 0.0)
    assert clearance(drawn_map()).open[beside]
    assert not ClearanceMap(drawn_map(), ahead).open[beside]


def test_lanes_count_apart_from_obstacles() -> None:
    site_map = replace(drawn_map(), lanes_m=np.array([[-0.7, 0.0]]))
    found = Distances(site_map, NONE)
    assert found.lane_m[ORIGIN] == pytest.approx(0.7)
    assert found.obstacle_m[ORIGIN] == math.inf
    assert not ClearanceMap(site_map, NONE).roomy[24, 30]


def test_views_that_are_off_the_map_widen_the_distances() -> None:
    margins = Margins()
    assert margins.by(0.016) == margins
    unsure = margins.by(0.026)
    assert (unsure.touch_m, unsure.edge_m) == pytest.approx((0.48, 0.38))
    assert margins.by(1.0).touch_m == pytest.approx(0.52)
    site_map = drawn_map(obstacles=np.array([[1.0, 0.0]]))
    assert clearance(replace(site_map, residual_m=0.05)).open.sum() < clearance(site_map).open.sum()


def test_walls_all_round_shut_in() -> None:
    assert clearance(drawn_map(obstacles=0.8 * RING)).shut_in
    assert not clearance(drawn_map()).shut_in


def test_the_unknown_is_kept_away_from_on_all_sides_alike() -> None:
    hidden = (np.abs(X) < 0.25) & (np.abs(Y) < 0.25)
    clear_m = clearance(drawn_map(known=~hidden, pose=(-1.5, -1.5, 0.0))).clear_m
    assert np.array_equal(clear_m, clear_m[::-1])
    assert np.array_equal(clear_m, clear_m[:, ::-1])
    assert clear_m[30, 36] == pytest.approx(0.4 + 0.4 - Margins.unknown_m)
    # A single cell that no ray has met is not unknown.
    speck = (np.abs(X) < 0.05) & (np.abs(Y) < 0.05)
    found = clearance(drawn_map(known=~speck, pose=(-1.5, -1.5, 0.0)))
    assert found.clear_m[30, 31] > Margins.wide_m


# --- fastest paths against SciPy's search ---------------------------------------------------------

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


# --- recent obstacles that the map lacks ----------------------------------------------------------


@pytest.mark.parametrize("least", [1, 3])
def test_points_with_enough_others_nearby(least: int) -> None:
    rng = np.random.default_rng(2)
    points_m, others_m = rng.random((60, 2)) * 3.0, rng.random((40, 2)) * 3.0
    apart_m = np.linalg.norm(points_m[:, None] - others_m, axis=-1)
    expected = (apart_m < 0.3).sum(axis=1) >= least
    assert expected.any()
    assert not expected.all()
    np.testing.assert_array_equal(has_near(points_m, others_m, 0.3, least), expected)


def test_a_distance_of_exactly_the_limit_and_no_others_are_not_near() -> None:
    none_m, points_m = np.empty((0, 2)), np.array([[0.0, 0.0], [3.0, 0.0]])
    assert has_near(points_m, np.array([[0.0, 0.5]]), 0.5, 1).tolist() == [False, False]
    assert has_near(points_m, np.array([[0.0, 0.5]]), 0.51, 1).tolist() == [True, False]
    assert has_near(none_m, points_m, 1.0, 1).tolist() == []
    assert has_near(points_m, none_m, 1.0, 1).tolist() == [False, False]
