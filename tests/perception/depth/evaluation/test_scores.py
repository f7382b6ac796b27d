"""Scores of depth maps: what each of them does and does not depend on."""

from dataclasses import replace

import numpy as np
import pytest

from perception.depth.evaluation.scores import DepthSample, score_depth
from uav_bt.errors import ShapeError, ValueRangeError


def _sample(factor: float = 1.0, obstacle: float = 1.0) -> DepthSample:
    truth = np.full((20, 30), 2.0, np.float32)
    ids = np.ones((20, 30), np.uint8)
    ids[:5] = 4
    ids[5:6] = 0
    predicted = factor * truth
    predicted[:5] *= obstacle
    return DepthSample(predicted=predicted, truth_m=truth, ids=ids, ground_m=truth.copy())


def test_the_unit_of_relative_depth_does_not_matter() -> None:
    score = score_depth([_sample(factor=7.0)])
    assert score.abs_rel == pytest.approx(0.0, abs=1e-6)
    assert score.obstacle_error_m == pytest.approx(0.0, abs=1e-6)
    assert score.metric_error_m == pytest.approx(12.0)
    assert score.delta_1 == 1.0


def test_obstacles_are_measured_with_the_carpets_scale() -> None:
    score = score_depth([_sample(factor=3.0, obstacle=1.1)])
    assert score.obstacle_error_m == pytest.approx(0.2, rel=1e-4)
    assert score.obstacle_abs_rel == pytest.approx(0.1, rel=1e-4)
    assert score.carpet_error_m == pytest.approx(0.0, abs=1e-6)


def test_a_view_without_carpet_has_no_metric_error() -> None:
    sample = _sample()
    blind = replace(sample, ids=np.full_like(sample.ids, 4))
    score = score_depth([blind, sample])
    assert score.pictures == 2
    assert score.obstacle_error_m == pytest.approx(0.0, abs=1e-6)


def test_maps_of_two_sizes_are_refused() -> None:
    with pytest.raises(ShapeError, match="the maps of a sample must be 20x30, got 10x30"):
        score_depth([replace(_sample(), ids=np.ones((10, 30), np.uint8))])


def test_a_depth_that_is_not_positive_is_refused() -> None:
    with pytest.raises(ValueRangeError, match="positive and finite"):
        score_depth([_sample(factor=-1.0)])


def test_nothing_to_score_is_refused() -> None:
    with pytest.raises(ValueRangeError, match="no pictures"):
        score_depth([])
