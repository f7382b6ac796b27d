"""Recent obstacles that the map lacks, against distances by NumPy."""

import numpy as np
import pytest

from behaviours.path.compiled_loops import has_near


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
