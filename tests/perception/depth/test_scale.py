"""The scale of relative depth: on known depth, from the ground, and without ground."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.camera.ground_plane import CameraView, ground_depth
from perception.depth.scale import (
    AdaptiveScale,
    GroundSample,
    Scale,
    ScaleConfig,
    ScaleFilter,
    ScaleFilterConfig,
    sample_ground,
)
from sim_bridge.anafi import anafi_camera
from tests.paper_lab import BACKGROUND, BOXES, CARPET
from uav_bt.errors import ShapeError, ValueRangeError

CAMERA = anafi_camera(640, 360).resized(224, 112)
VIEW = CameraView(camera=CAMERA, pitch_rad=math.radians(-28), height_m=1.5)
RNG_SEED = 4


def ground_ids() -> np.ndarray:
    return np.full((112, 224), CARPET, dtype=np.uint8)


def predicted(scale: float = 2.5, shift_m: float = 0.0) -> np.ndarray:
    """Output of a perfect network of that scale: ``(truth - shift) / scale``."""
    return ((ground_depth(VIEW) - shift_m) / scale).astype(np.float32)


def sample(
    relative: np.ndarray, ids: np.ndarray | None = None, config: ScaleConfig | None = None
) -> GroundSample | None:
    generator = np.random.default_rng(RNG_SEED)
    shown = ground_ids() if ids is None else ids
    return sample_ground(relative, shown == CARPET, ground_depth(VIEW), generator, config)


# --- sampling -------------------------------------------------------------------------------------


def test_fifty_different_ground_pixels_are_drawn() -> None:
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


def test_pixels_keep_their_distance_to_the_grounds_border_not_to_the_images() -> None:
    """4 of 112 rows are the paper's 10 of 256; the ground goes on below the image."""
    ids = ground_ids()
    ids[:, 100:] = BOXES[2]
    generator = np.random.default_rng(0)
    drawn = sample_ground(
        predicted(), ids == CARPET, ground_depth(VIEW), generator, ScaleConfig(points=5000)
    )

    assert drawn is not None
    columns, rows = drawn.pixels.T
    assert columns.max() == 95
    assert columns.min() == 0
    assert rows.max() == 111


def test_far_ground_and_impossible_predictions_are_left_out() -> None:
    relative = predicted()
    relative[:, :112] = np.nan
    relative[60:, 112:] = -1.0
    drawn = sample(relative, config=ScaleConfig(max_range_m=4.0))

    assert drawn is not None
    columns, rows = drawn.pixels.T
    assert columns.min() >= 112
    assert rows.max() < 60
    assert drawn.known_m.max() <= 4.0


@pytest.mark.parametrize("rows", [0, 8])
def test_too_little_ground_is_no_sample(rows: int) -> None:
    """A strip that is narrower than twice the margin has no inner pixels."""
    ids = np.full((112, 224), BACKGROUND, dtype=np.uint8)
    ids[50 : 50 + rows] = CARPET
    assert sample(predicted(), ids) is None


def test_maps_of_other_sizes_are_refused() -> None:
    with pytest.raises(ShapeError, match="112x224"):
        sample(np.ones((5, 5), dtype=np.float32))
    small = np.ones((5, 5), dtype=np.uint8)
    with pytest.raises(ShapeError, match="depth of the ground"):
        sample(small.astype(np.float32), small)


def test_impossible_sampling_is_refused() -> None:
    with pytest.raises(ValueRangeError, match="min_points"):
        ScaleConfig(points=10, min_points=11)


# --- estimators -----------------------------------------------------------------------------------


def test_the_adaptive_scale_follows_a_network_whose_unit_changes() -> None:
    """The network's unit halves: a second later the scale has doubled."""
    estimator, scale = AdaptiveScale(), None
    for frame in range(40):
        scale = estimator.update(sample(predicted(2.0 if frame < 30 else 4.0)), 0.1 * frame)

    assert scale is not None
    assert scale.factor == pytest.approx(4.0, rel=0.01)
    assert scale.shift_m == 0.0


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
    assert clean.confidence > 0.8
    assert rough.confidence < 0.3
    assert few.confidence < clean.confidence - 0.1
    assert clean.why is not None
    assert clean.why.value == clean.confidence


def test_without_ground_the_scale_carries_on_for_a_while_and_then_is_none() -> None:
    estimator = AdaptiveScale()
    assert estimator.update(None, 0.0) is None
    first = estimator.update(sample(predicted()), 0.1)
    carried = estimator.update(None, 0.6)

    assert first is not None
    assert carried is not None
    assert carried.factor == pytest.approx(first.factor)
    assert carried.confidence < 0.5 < first.confidence
    assert estimator.update(None, 60.0) is None


def test_a_frame_that_disagrees_leaves_the_scale_and_lowers_its_confidence() -> None:
    estimator = AdaptiveScale()
    first = estimator.update(sample(predicted(2.0)), 0.0)
    other = estimator.update(sample(predicted(4.0)), 0.1)
    assert first is not None
    assert other is not None
    assert other.factor == pytest.approx(first.factor)
    assert other.confidence < 0.5 < first.confidence
    assert other.why is not None
    assert "with which this one disagrees" in other.why.reason


def test_a_doubtful_scale_is_no_surer_when_it_is_carried_on() -> None:
    estimator = AdaptiveScale()
    first = estimator.update(sample(np.full((112, 224), 1.5, dtype=np.float32)), 0.0)
    carried = estimator.update(None, 0.1)
    assert first is not None
    assert carried is not None
    assert carried.confidence < first.confidence < 0.5
    estimator.restart()
    assert estimator.update(None, 0.2) is None


def test_a_scale_applies_factor_and_shift() -> None:
    metres = Scale(factor=2.0, shift_m=0.5).apply(np.array([[1.0, 2.0]], dtype=np.float32))
    assert metres == pytest.approx(np.array([[2.5, 4.5]]))
    assert metres.dtype == np.float32


def test_noise_is_smoothed() -> None:
    """The spread of the output is well below that of the measurements."""
    generator = np.random.default_rng(0)
    smooth = ScaleFilter()
    found = []
    for frame in range(200):
        smooth.update(0.7 + generator.normal(0.0, 0.03), 0.03, 0.1 * frame)
        state = smooth.at(0.1 * frame)
        assert state is not None
        found.append(state[0])
    assert np.std(found[20:]) < 0.02
    assert np.mean(found[20:]) == pytest.approx(0.7, abs=0.01)


def test_an_outlier_is_turned_away_and_a_new_level_is_believed_in_the_end() -> None:
    smooth = ScaleFilter()
    for frame in range(10):
        assert smooth.update(0.0, 0.01, 0.1 * frame)
    assert not smooth.update(0.6, 0.01, 1.0)
    state = smooth.at(1.0)
    assert state is not None
    assert abs(state[0]) < 0.01

    taken = [smooth.update(0.6, 0.01, 1.1 + 0.1 * frame) for frame in range(6)]
    assert taken == [False] * 4 + [True, True]
    state = smooth.at(1.6)
    assert state is not None
    assert state[0] == pytest.approx(0.6, abs=0.01)


def test_doubt_grows_until_there_is_no_scale() -> None:
    smooth = ScaleFilter(ScaleFilterConfig(wander_std=0.05, lost_std=0.15))
    assert smooth.at(0.0) is None
    smooth.update(0.2, 0.01, 0.0)
    certain, later = smooth.at(0.0), smooth.at(4.0)

    assert certain is not None
    assert later is not None
    assert certain[1] > later[1] > 0.0
    assert smooth.at(10.0) is None


def test_time_does_not_run_backwards() -> None:
    smooth = ScaleFilter()
    smooth.update(0.0, 0.01, 5.0)
    before = smooth.at(5.0)
    assert smooth.at(1.0) == before


@pytest.mark.parametrize(
    "wrong", [(math.nan, 0.1, 0.0), (0.0, math.inf, 0.0), (0.0, 0.1, math.nan)]
)
def test_what_is_not_finite_is_refused(wrong: tuple[float, float, float]) -> None:
    with pytest.raises(ValueRangeError, match="finite"):
        ScaleFilter().update(*wrong)


def test_impossible_noise_is_refused() -> None:
    with pytest.raises(ValueRangeError, match="positive"):
        ScaleFilterConfig(floor_std=0.0)
