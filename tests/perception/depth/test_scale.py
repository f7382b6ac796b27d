"""Scales: the three methods on known depth, sampling, and honest refusals."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.camera.ground_plane import CameraView, ground_depth
from perception.depth.scale import (
    AdaptiveScale,
    CarpetSample,
    CollectedScale,
    Scale,
    ScaleConfig,
    fit_least_squares,
    fit_ratio,
    make_scale,
    region_value,
    sample_carpet,
)
from sim_bridge.anafi import anafi_camera
from uav_bt.classes import BACKGROUND, BOXES, CARPET
from uav_bt.errors import ShapeError, UnknownNameError, ValueRangeError

CAMERA = anafi_camera(640, 360).resized(224, 112)
VIEW = CameraView(camera=CAMERA, pitch_rad=math.radians(-28), height_m=1.5)
RNG_SEED = 4


def carpet_ids() -> np.ndarray:
    return np.full((112, 224), CARPET, dtype=np.uint8)


def predicted(scale: float = 2.5, shift_m: float = 0.0) -> np.ndarray:
    """What a perfect network of that scale would say: ``(truth - shift) / scale``."""
    return ((ground_depth(VIEW) - shift_m) / scale).astype(np.float32)


def sample(
    relative: np.ndarray, ids: np.ndarray | None = None, config: ScaleConfig | None = None
) -> CarpetSample | None:
    generator = np.random.default_rng(RNG_SEED)
    return sample_carpet(relative, carpet_ids() if ids is None else ids, VIEW, generator, config)


# --- sampling -------------------------------------------------------------------------------------


def test_fifty_different_carpet_pixels_are_drawn() -> None:
    drawn = sample(predicted())

    assert drawn is not None
    assert len(drawn) == 50
    assert len(np.unique(drawn.pixels, axis=0)) == 50
    columns, rows = drawn.pixels.T
    assert drawn.known_m == pytest.approx(ground_depth(VIEW)[rows, columns])
    assert drawn.known_m / drawn.predicted == pytest.approx(np.full(50, 2.5), rel=1e-5)


def test_the_same_seed_draws_the_same_pixels() -> None:
    first, again = sample(predicted()), sample(predicted())
    assert first is not None
    assert again is not None
    assert (first.pixels == again.pixels).all()


def test_pixels_keep_their_distance_to_the_carpets_border_not_to_the_images() -> None:
    """4 of 112 rows are the paper's 10 of 256; the carpet goes on below the image."""
    ids = carpet_ids()
    ids[:, 100:] = BOXES[2]
    generator = np.random.default_rng(0)
    drawn = sample_carpet(predicted(), ids, VIEW, generator, ScaleConfig(points=5000))

    assert drawn is not None
    columns, rows = drawn.pixels.T
    assert columns.max() == 95
    assert columns.min() == 0
    assert rows.max() == 111


def test_far_carpet_and_impossible_predictions_are_left_out() -> None:
    relative = predicted()
    relative[:, :112] = np.nan
    relative[60:, 112:] = -1.0
    drawn = sample(relative, config=ScaleConfig(farthest_m=4.0))

    assert drawn is not None
    columns, rows = drawn.pixels.T
    assert columns.min() >= 112
    assert rows.max() < 60
    assert drawn.known_m.max() <= 4.0


@pytest.mark.parametrize("rows", [0, 8])
def test_too_little_carpet_is_no_sample(rows: int) -> None:
    """A strip that is narrower than twice the margin has no inner pixels."""
    ids = np.full((112, 224), BACKGROUND, dtype=np.uint8)
    ids[50 : 50 + rows] = CARPET
    assert sample(predicted(), ids) is None


def test_maps_of_other_sizes_are_refused() -> None:
    with pytest.raises(ShapeError, match="112x224"):
        sample(np.ones((5, 5), dtype=np.float32))
    small = np.ones((5, 5), dtype=np.uint8)
    with pytest.raises(ShapeError, match="as its camera"):
        sample(small.astype(np.float32), small)


def test_impossible_sampling_is_refused() -> None:
    with pytest.raises(ValueRangeError, match="least_points"):
        ScaleConfig(points=10, least_points=11)


# --- fits -----------------------------------------------------------------------------------------


def test_equation_1_is_solved_for_scale_and_shift() -> None:
    given = np.linspace(0.5, 3.0, 20)
    solved = fit_least_squares(1.7 * given + 0.3, given)

    assert solved == pytest.approx((1.7, 0.3))


def test_least_squares_agrees_with_the_textbook_on_noisy_pairs() -> None:
    generator = np.random.default_rng(1)
    given = generator.uniform(0.5, 3.0, 40)
    known = 2.0 * given - 0.1 + generator.normal(0.0, 0.05, 40)

    expected = np.linalg.lstsq(np.stack([given, np.ones(40)], axis=1), known, rcond=None)[0]
    assert fit_least_squares(known, given) == pytest.approx(tuple(expected))


def test_predictions_that_are_alike_have_no_shift() -> None:
    assert fit_least_squares(np.array([1.0, 1.1, 0.9]), np.full(3, 0.5)) is None


def test_a_ratio_is_the_median_and_needs_positive_predictions() -> None:
    assert fit_ratio(np.array([1.0, 2.0, 30.0]), np.ones(3)) == 2.0
    with pytest.raises(ValueRangeError, match="positive"):
        fit_ratio(np.ones(2), np.array([1.0, 0.0]))
    with pytest.raises(ShapeError, match="at least 1"):
        fit_ratio(np.empty(0), np.empty(0))
    with pytest.raises(ShapeError, match="at least 2"):
        fit_least_squares(np.ones(1), np.ones(1))


def test_a_region_has_a_mean_a_median_and_a_minimum() -> None:
    values = np.array([1.0, 2.0, 6.0])
    assert region_value(values, "mean") == 3.0
    assert region_value(values, "median") == 2.0
    assert region_value(values, "min") == 1.0


# --- estimators -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "name",
    [
        *("adaptive", "constant", "least_squares", "constant:min", "constant:mean"),
        *("least_squares:median", "least_squares:mean", "least_squares:min"),
    ],
)
def test_every_method_finds_the_scale_of_a_perfect_network(name: str) -> None:
    estimator, scale = make_scale(name), None
    for frame in range(5):
        scale = estimator.update(sample(predicted()), 0.1 * frame)

    assert scale is not None
    assert scale.apply(predicted())[60, 100] == pytest.approx(ground_depth(VIEW)[60, 100], rel=1e-4)


def test_least_squares_finds_a_shift_where_frames_differ() -> None:
    """Frames from several heights: the ratio alone cannot explain them."""
    estimator = CollectedScale("least_squares")
    scale = None
    for frame, height_m in enumerate((1.0, 1.3, 1.6, 1.9)):
        view = CameraView(camera=CAMERA, pitch_rad=VIEW.pitch_rad, height_m=height_m)
        relative = ((ground_depth(view) - 0.4) / 3.0).astype(np.float32)
        drawn = sample_carpet(relative, carpet_ids(), view, np.random.default_rng(frame))
        scale = estimator.update(drawn, float(frame))

    assert scale is not None
    assert scale.factor == pytest.approx(3.0, rel=1e-3)
    assert scale.shift_m == pytest.approx(0.4, abs=5e-3)


def test_the_adaptive_scale_follows_where_a_constant_cannot() -> None:
    """The network's unit halves: adaptive has it within a second, the constant lags behind."""
    adaptive, constant = make_scale("adaptive"), make_scale("constant")
    results = []
    for frame in range(40):
        drawn = sample(predicted(2.0 if frame < 30 else 4.0))
        results.append((adaptive.update(drawn, 0.1 * frame), constant.update(drawn, 0.1 * frame)))

    followed, lagging = results[-1]
    assert followed is not None
    assert lagging is not None
    assert followed.factor == pytest.approx(4.0, rel=0.01)
    assert lagging.factor == pytest.approx(2.0, rel=0.01)


def test_wrong_masks_on_a_third_of_the_points_do_not_move_the_median() -> None:
    relative = predicted()
    relative[:, :70] *= 3.0
    scale = AdaptiveScale().update(sample(relative), 0.0)

    assert scale is not None
    assert scale.factor == pytest.approx(2.5, rel=0.02)


def test_confidence_falls_with_scatter_and_with_few_points() -> None:
    generator = np.random.default_rng(0)
    noise = generator.lognormal(0.0, 0.3, (112, 224)).astype(np.float32)
    clean = AdaptiveScale().update(sample(predicted()), 0.0)
    rough = AdaptiveScale().update(sample(predicted() * noise), 0.0)
    ids = np.full((112, 224), BACKGROUND, dtype=np.uint8)
    ids[60:74, 80:94] = CARPET
    few = AdaptiveScale().update(sample(predicted(), ids), 0.0)

    assert clean is not None
    assert rough is not None
    assert few is not None
    assert clean.confidence > 0.95
    assert rough.confidence < 0.3
    assert few.confidence < 0.8


def test_without_carpet_the_scale_carries_on_for_a_while_and_then_is_none() -> None:
    estimator = AdaptiveScale()
    assert estimator.update(None, 0.0) is None
    first = estimator.update(sample(predicted()), 0.1)
    carried = estimator.update(None, 0.6)

    assert first is not None
    assert carried is not None
    assert carried.factor == pytest.approx(first.factor)
    assert carried.confidence < 0.5 < first.confidence
    assert estimator.update(None, 60.0) is None


def test_a_collected_scale_without_frames_is_none() -> None:
    assert CollectedScale("constant").update(None, 0.0) is None


@pytest.mark.parametrize("name", ["adaptve", "constant:max", "adaptive:mean", ""])
def test_unknown_methods_are_told_with_what_is_known(name: str) -> None:
    with pytest.raises(UnknownNameError, match="least_squares"):
        make_scale(name)


def test_a_scale_applies_factor_and_shift() -> None:
    metres = Scale(factor=2.0, shift_m=0.5).apply(np.array([[1.0, 2.0]], dtype=np.float32))
    assert metres == pytest.approx(np.array([[2.5, 4.5]]))
    assert metres.dtype == np.float32
