"""Scores of depth maps: what each of them does and does not depend on."""

import math
from dataclasses import replace

import numpy as np
import pytest

from perception.depth.evaluation.scores import (
    DepthSample,
    PointConfig,
    draw_points,
    ranges_at,
    score_depth,
    summarise_errors,
)
from tests.paper_lab import BACKGROUND, BOXES, CARPET, CLASSES, paper_map
from uav_bt.errors import ShapeError, ValueRangeError
from uav_bt.lab.classes import OBSTACLE
from uav_bt.types import CameraModel


def _sample(factor: float = 1.0, obstacle: float = 1.0) -> DepthSample:
    truth = np.full((20, 30), 2.0, np.float32)
    ids = np.ones((20, 30), np.uint8)
    ids[:5] = 4
    ids[5:6] = 0
    predicted = factor * truth
    predicted[:5] *= obstacle
    return DepthSample(
        predicted=predicted, truth_m=truth, roles=CLASSES.roles(ids), ground_m=truth.copy()
    )


def test_the_unit_of_relative_depth_does_not_matter() -> None:
    score = score_depth([_sample(factor=7.0)])
    assert score.abs_rel == pytest.approx(0.0, abs=1e-6)
    assert score.obstacle_error_m == pytest.approx(0.0, abs=1e-6)
    assert score.metric_error_m == pytest.approx(12.0)
    assert score.delta_1 == 1.0


def test_obstacles_are_measured_with_the_grounds_scale() -> None:
    score = score_depth([_sample(factor=3.0, obstacle=1.1)])
    assert score.obstacle_error_m == pytest.approx(0.2, rel=1e-4)
    assert score.obstacle_abs_rel == pytest.approx(0.1, rel=1e-4)
    assert score.ground_error_m == pytest.approx(0.0, abs=1e-6)


def test_a_view_without_ground_has_no_metric_error() -> None:
    sample = _sample()
    blind = replace(sample, roles=np.full_like(sample.roles, OBSTACLE))
    score = score_depth([blind, sample])
    assert score.images == 2
    assert score.obstacle_error_m == pytest.approx(0.0, abs=1e-6)


def test_maps_of_two_sizes_are_refused() -> None:
    with pytest.raises(ShapeError, match="the maps of a sample must be 20x30, got 10x30"):
        score_depth([replace(_sample(), roles=np.ones((10, 30), np.uint8))])


def test_a_depth_that_is_not_positive_is_refused() -> None:
    with pytest.raises(ValueRangeError, match="positive and finite"):
        score_depth([_sample(factor=-1.0)])


def test_nothing_to_score_is_refused() -> None:
    with pytest.raises(ValueRangeError, match="no images"):
        score_depth([])


# --- lengths --------------------------------------------------------------------------------------


def test_figures_are_those_worked_out_by_hand() -> None:
    summary = summarise_errors(np.array([1.1, 2.3, 2.8, 4.0]), np.array([1.0, 2.0, 3.0, 4.0]))
    assert summary.mean_m == pytest.approx(0.15)
    assert summary.median_m == pytest.approx(0.15)
    assert summary.rmse_m == pytest.approx(math.sqrt(0.14 / 4))
    assert summary.max_m == pytest.approx(0.3)
    assert summary.bias_m == pytest.approx(0.05)
    assert summary.rmse_m**2 == pytest.approx(summary.mean_m**2 + summary.std_m**2)
    assert summary.correlation == pytest.approx(
        np.corrcoef([1.1, 2.3, 2.8, 4.0], [1.0, 2.0, 3.0, 4.0])[0, 1]
    )


def test_what_is_not_known_counts_for_coverage_only() -> None:
    summary = summarise_errors(np.array([1.5, np.nan, np.nan, 2.5]), np.array([1.0, 9.0, 9.0, 2.0]))
    assert (summary.total, summary.valid, summary.coverage) == (4, 2, 0.5)
    assert summary.mean_m == pytest.approx(0.5)


@pytest.mark.parametrize("count", [0, 3])
def test_without_any_estimate_the_figures_are_no_numbers(count: int) -> None:
    summary = summarise_errors(np.full(count, np.nan), np.ones(count))
    assert summary.valid == 0
    assert math.isnan(summary.mean_m)
    assert math.isnan(summary.correlation)
    assert math.isnan(summary.coverage) == (count == 0)


def test_estimates_that_never_vary_correlate_with_nothing() -> None:
    summary = summarise_errors(np.array([2.0, 2.0]), np.array([1.0, 3.0]))
    assert math.isnan(summary.correlation)


def test_lists_of_unequal_length_are_refused() -> None:
    with pytest.raises(ShapeError, match="estimates must be 2"):
        summarise_errors(np.ones(3), np.ones(2))


@pytest.mark.parametrize(("estimated", "truth"), [(np.inf, 1.0), (1.0, np.nan), (1.0, np.inf)])
def test_infinite_estimates_and_unknown_truths_are_refused(estimated: float, truth: float) -> None:
    with pytest.raises(ValueRangeError, match="finite"):
        summarise_errors(np.array([estimated]), np.array([truth]))


CAMERA = CameraModel(width_px=224, height_px=112, fx_px=160.0, fy_px=150.0, cx_px=111.5, cy_px=55.5)
IDS = np.full((112, 224), BACKGROUND, dtype=np.uint8)
IDS[20:60, 30:90] = BOXES[3]
IDS[60:] = CARPET
DEPTH_M = np.full((112, 224), 2.0, dtype=np.float32)


def test_points_lie_inside_obstacles_and_ground() -> None:
    points = draw_points(paper_map(IDS), DEPTH_M, CAMERA, np.random.default_rng(0))
    columns, rows = points.pixels.T
    assert len(points) == 80
    assert points.obstacle.sum() == 40
    own = IDS[rows, columns]
    assert (own[points.obstacle] == BOXES[3]).all()
    assert (own[~points.obstacle] == CARPET).all()
    for step in (-2, 2):
        assert (IDS[np.minimum(rows + step, 111), columns] == own).all()
        assert (IDS[rows, np.clip(columns + step, 0, 223)] == own).all()


def test_the_range_is_along_the_ray() -> None:
    points = draw_points(paper_map(IDS), DEPTH_M, CAMERA, np.random.default_rng(0))
    x = (points.pixels[:, 0] - CAMERA.cx_px) / CAMERA.fx_px
    y = (points.pixels[:, 1] - CAMERA.cy_px) / CAMERA.fy_px
    np.testing.assert_allclose(points.range_m, 2.0 * np.sqrt(1 + x**2 + y**2), rtol=1e-6)
    np.testing.assert_allclose(ranges_at(DEPTH_M, points, CAMERA), points.range_m)
    assert np.isnan(ranges_at(np.full_like(DEPTH_M, np.nan), points, CAMERA)).all()


@pytest.mark.parametrize("depth_m", [0.1, 7.0])
def test_nothing_is_drawn_out_of_reach(depth_m: float) -> None:
    far = np.full_like(DEPTH_M, depth_m)
    assert len(draw_points(paper_map(IDS), far, CAMERA, np.random.default_rng(0))) == 0


def test_maps_of_another_size_are_refused() -> None:
    with pytest.raises(ShapeError, match="depth map must be 112x224"):
        draw_points(paper_map(IDS), DEPTH_M[:50], CAMERA, np.random.default_rng(0))


def test_unusable_settings_are_refused() -> None:
    with pytest.raises(ValueRangeError, match="min_range_m"):
        PointConfig(min_range_m=5.0, max_range_m=1.0)
