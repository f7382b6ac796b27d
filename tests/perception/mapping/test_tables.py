"""Tables of points: clusters, nearest circles, and one point in each cell."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.cluster.hierarchy import fcluster, linkage

from perception.mapping.tables import clusters, first_in_cells, nearest_circles


@pytest.mark.parametrize("seed", range(5))
def test_clusters_are_those_of_single_linkage(seed: int) -> None:
    xy_m = np.random.default_rng(seed).uniform(0.0, 4.0, (60, 2))
    labels = clusters(xy_m, 0.3)
    expected = fcluster(linkage(xy_m), 0.3, criterion="distance")
    together, expected_together = (one[:, None] == one for one in (labels, expected))
    assert np.array_equal(together, expected_together)


def test_clusters_are_numbered_by_their_first_points() -> None:
    xy_m = np.array([[5.0, 0.0], [0.0, 0.0], [5.2, 0.0], [0.3, 0.0], [0.6, 0.0], [9.0, 0.0]])
    assert clusters(xy_m, 0.31).tolist() == [0, 1, 0, 1, 1, 2]


def test_no_points_no_clusters() -> None:
    assert clusters(np.empty((0, 2)), 0.3).tolist() == []


def test_the_nearest_circle_may_have_the_farther_centre() -> None:
    xy_m = np.array([[0.0, 0.0], [3.0, 4.0]])
    off_m, nearest = nearest_circles(xy_m, np.array([[1.0, 0.0], [0.0, 2.0]]), np.array([0.1, 1.5]))
    assert off_m == pytest.approx([0.5, np.hypot(3.0, 2.0) - 1.5])
    assert nearest.tolist() == [1, 1]


def test_without_circles_all_are_far() -> None:
    off_m, _ = nearest_circles(np.zeros((2, 2)), np.empty((0, 2)), np.empty(0))
    assert off_m.tolist() == [np.inf, np.inf]


def test_of_a_cell_the_first_point_by_its_keys_is_kept() -> None:
    """Three points in cell (0, 0), one in cell (-1, 0), which comes first."""
    xy_m = np.array([[0.01, 0.01], [0.02, 0.02], [0.03, 0.03], [-0.01, 0.01]])
    assert first_in_cells(xy_m, 0.1).tolist() == [3, 0]
    assert first_in_cells(xy_m, 0.1, np.array([5.0, 4.0, 3.0, 9.0])).tolist() == [3, 2]
    kinds = np.array([1, 0, 1, 0], dtype=np.int8)  # the more important key
    assert first_in_cells(xy_m, 0.1, np.array([5.0, 4.0, 3.0, 9.0]), kinds).tolist() == [3, 1]
