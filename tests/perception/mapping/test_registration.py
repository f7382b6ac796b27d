"""The least squares of one round of matching."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from perception.mapping.registration import _GATE_M, _LINE_RATIO, _LINE_REACH_M, _equations


@pytest.mark.parametrize("seed", range(4))
def test_each_place_is_matched_across_the_line_of_its_neighbours(seed: int) -> None:
    rng = np.random.default_rng(seed)
    along_m = rng.uniform(-2.0, 2.0, 150)
    wall_m = np.column_stack([along_m, 0.3 * along_m + rng.normal(0.0, 0.01, 150)])
    known_m = np.concatenate([wall_m, rng.uniform(-2.0, 2.0, (60, 2))])
    places_m = known_m[::3] + rng.normal(0.0, 0.1, (70, 2))
    origin_m, std_m = np.array([0.4, -0.2]), rng.uniform(0.03, 0.08, 70)
    distances_m, indices = cKDTree(known_m).query(places_m, k=6)

    expected_m, slopes, weights = [], [], []
    for place_m, near_m, rows, std in zip(places_m, distances_m, indices, std_m, strict=True):
        if near_m[0] > _GATE_M:
            continue
        around_m = known_m[rows[near_m <= near_m[0] + _LINE_REACH_M]]
        spread_m = around_m - around_m.mean(axis=0)
        values, vectors = np.linalg.eigh(spread_m.T @ spread_m)
        if values[1] > _LINE_RATIO * max(values[0], 1e-9):
            normal, foot_m = vectors[:, 0], around_m.mean(axis=0)
        else:
            normal, foot_m = (place_m - around_m[0]) / near_m[0], around_m[0]
        x_m, y_m = place_m - origin_m
        expected_m.append(normal @ (place_m - foot_m))
        slopes.append([*normal, normal[1] * x_m - normal[0] * y_m])
        weights.append(1.0 / (1.0 + (expected_m[-1] / std) ** 2) / std**2)

    residuals_m, hessian, gradient = _equations(
        places_m, origin_m, std_m, distances_m, indices, known_m
    )
    slope, weight = np.array(slopes), np.array(weights)
    assert 20 < len(residuals_m) == len(expected_m)
    # A normal and its opposite are the same line.
    assert np.abs(residuals_m) == pytest.approx(np.abs(expected_m), rel=1e-9, abs=1e-12)
    assert hessian == pytest.approx(slope.T @ (weight[:, None] * slope), rel=1e-9, abs=1e-7)
    assert gradient == pytest.approx(slope.T @ (weight * expected_m), rel=1e-9, abs=1e-7)
