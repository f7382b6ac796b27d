"""The map's points: how sightings move them, and when they go."""

from __future__ import annotations

import numpy as np
import pytest

from perception.mapping.landmarks import LandmarkConfig, Landmarks, drop_missed, merge


def points(*xy_m: tuple[float, float], weight: float = 1.0) -> Landmarks:
    zeros = np.zeros(len(xy_m))
    return Landmarks(
        xy_m=np.array(xy_m),
        weight=zeros + weight,
        first_s=zeros,
        seen_s=zeros,
        settled_s=zeros,
        from_m=np.zeros((len(xy_m), 2)),
        ids=np.full(len(xy_m), 4, dtype=np.uint8),
        missed=zeros.copy(),
    )


def test_a_point_moves_to_the_weighted_mean_of_its_sightings() -> None:
    """(1 x 1.00 + 3 x 1.06) / 4 = 1.045."""
    found = merge(points((1.0, 0.0)), points((1.06, 0.0), weight=3.0), LandmarkConfig())
    assert found.xy_m == pytest.approx(np.array([[1.045, 0.0]]))
    assert found.weight == pytest.approx([4.0])


def test_two_sightings_of_one_point_in_a_view_both_count() -> None:
    """(1.00 + 1.05 + 0.95) / 3 = 1.00, of three sightings' weight."""
    found = merge(points((1.0, 0.0)), points((1.05, 0.0), (0.95, 0.0)), LandmarkConfig())
    assert found.xy_m == pytest.approx(np.array([[1.0, 0.0]]))
    assert found.weight == pytest.approx([3.0])


def test_a_point_that_enough_sightings_have_placed_stays() -> None:
    found = merge(points((1.0, 0.0), weight=3.0), points((1.05, 0.0)), LandmarkConfig())
    assert found.xy_m == pytest.approx(np.array([[1.0, 0.0]]))
    assert found.weight == pytest.approx([4.0])


def test_a_point_goes_after_as_many_views_as_placed_it() -> None:
    """Weight 5: the fifth view that shows ground there removes it. The given table is kept."""
    known, free = points((1.0, 0.0), weight=5.0), np.array([True])
    for _ in range(4):
        known = drop_missed(known, free, LandmarkConfig())
        assert len(known) == 1
    assert len(drop_missed(known, free, LandmarkConfig())) == 0
    assert known.missed == pytest.approx([4.0])
