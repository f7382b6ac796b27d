"""The map's points: how sightings move them, when they go, and how they are grouped."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.cluster.hierarchy import fcluster, linkage

from perception.mapping.landmarks import (
    Landmarks,
    clusters,
    drop_missed,
    first_in_cells,
    merge,
    nearest_circles,
)


def points(*xy_m: tuple[float, float], weight: float = 1.0, class_id: int = 4) -> Landmarks:
    """Return points seen once from the origin."""
    zeros = np.zeros(len(xy_m))
    return Landmarks(
        xy_m=np.array(xy_m),
        weight=zeros + weight,
        from_m=np.zeros((len(xy_m), 2)),
        ids=np.full(len(xy_m), class_id, dtype=np.uint8),
        **dict.fromkeys(("first_s", "seen_s", "settled_s", "missed"), zeros),
    )


@pytest.mark.parametrize(
    ("known", "seen", "x_m", "weight"),
    [
        pytest.param(1.0, [(1.06, 3.0)], 1.045, 4.0, id="weighted mean"),  # (1.00 + 3 x 1.06) / 4
        pytest.param(1.0, [(1.05, 1.0), (0.95, 1.0)], 1.0, 3.0, id="two sightings in a view"),
        pytest.param(3.0, [(1.05, 1.0)], 1.0, 4.0, id="enough sightings have placed it"),
    ],
)
def test_a_point_moves_to_the_weighted_mean_of_its_sightings(
    known: float, seen: list[tuple[float, float]], x_m: float, weight: float
) -> None:
    view = points(*[(x, 0.0) for x, _ in seen])
    view = replace(view, weight=np.array([each for _, each in seen]))
    found = merge(points((1.0, 0.0), weight=known), view)
    assert found.xy_m == pytest.approx(np.array([[x_m, 0.0]]))
    assert found.weight == pytest.approx([weight])


def test_a_point_goes_after_as_many_views_as_placed_it() -> None:
    """Weight 5: the fifth view that shows ground there removes it. The given table is kept."""
    known, free = points((1.0, 0.0), weight=5.0), np.array([True])
    for _ in range(4):
        known = drop_missed(known, free)
        assert len(known) == 1
    assert len(drop_missed(known, free)) == 0
    assert known.missed == pytest.approx([4.0])


@pytest.mark.parametrize("seed", range(3))
def test_clusters_are_those_of_single_linkage_in_the_order_of_first_points(seed: int) -> None:
    xy_m = np.random.default_rng(seed).uniform(0.0, 4.0, (60, 2))
    labels = clusters(xy_m, 0.3)
    expected = fcluster(linkage(xy_m), 0.3, criterion="distance")
    together, expected_together = (one[:, None] == one for one in (labels, expected))
    assert np.array_equal(together, expected_together)
    _, firsts = np.unique(labels, return_index=True)
    assert (np.diff(firsts) > 0).all()
    assert clusters(np.empty((0, 2)), 0.3).tolist() == []


def test_the_nearest_circle_may_have_the_farther_centre() -> None:
    xy_m = np.array([[0.0, 0.0], [3.0, 4.0]])
    off_m, nearest = nearest_circles(xy_m, np.array([[1.0, 0.0], [0.0, 2.0]]), np.array([0.1, 1.5]))
    assert off_m == pytest.approx([0.5, np.hypot(3.0, 2.0) - 1.5])
    assert nearest.tolist() == [1, 1]
    assert nearest_circles(xy_m, np.empty((0, 2)))[0].tolist() == [np.inf, np.inf]


def test_of_a_cell_the_first_point_by_its_keys_is_kept() -> None:
    """Three points in cell (0, 0), one in cell (-1, 0), which comes first."""
    xy_m = np.array([[0.01, 0.01], [0.02, 0.02], [0.03, 0.03], [-0.01, 0.01]])
    assert first_in_cells(xy_m, 0.1).tolist() == [3, 0]
    assert first_in_cells(xy_m, 0.1, np.array([5.0, 4.0, 3.0, 9.0])).tolist() == [3, 2]
    kinds = np.array([1, 0, 1, 0], dtype=np.int8)  # the more important key
    assert first_in_cells(xy_m, 0.1, np.array([5.0, 4.0, 3.0, 9.0]), kinds).tolist() == [3, 1]
