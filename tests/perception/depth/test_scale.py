"""The scale of relative depth: on known depth, from the ground, and without ground."""

import math

import numpy as np
import pytest

from perception.camera.ground_plane import CameraView, ground_depth
from perception.depth.scale import AdaptiveScale, GroundSample, ScaleFilter, sample_ground
from sim_bridge.anafi import anafi_camera
from uav_bt.types.arrays import Flags, Floats32

VIEW = CameraView(
    camera=anafi_camera(640, 360).resized(224, 112), pitch_rad=math.radians(-28), height_m=1.5
)
GROUND_M = ground_depth(VIEW)
ALL = np.full((112, 224), True)


def predicted(scale: float = 2.5) -> Floats32:
    """Output of a perfect network of that scale."""
    return np.asarray(GROUND_M / np.float32(scale), dtype=np.float32)


def sample(
    relative: Floats32, shown: Flags = ALL, seed: int = 4, max_range_m: float = 6.0
) -> GroundSample:
    return sample_ground(relative, shown, GROUND_M, np.random.default_rng(seed), max_range_m)


def pixels(shown: Flags = ALL, sound: Flags = ALL, *, draws: int = 1) -> np.ndarray:
    """Return rows and columns that are drawn where the predictions are sound."""
    number = np.arange(1.0, 1.0 + GROUND_M.size, dtype=np.float32).reshape(GROUND_M.shape)
    number[~sound] = -1.0
    drawn = [sample(number, shown, seed).predicted - 1.0 for seed in range(draws)]
    return np.stack(np.divmod(np.concatenate(drawn).astype(int), 224))


def test_fifty_different_ground_pixels_are_drawn_and_the_same_seed_draws_the_same() -> None:
    drawn, again = sample(predicted()), sample(predicted())
    assert drawn.known_m.shape == (50,)
    assert len(np.unique(pixels(), axis=1).T) == 50
    assert drawn.known_m / drawn.predicted == pytest.approx(np.full(50, 2.5), rel=1e-5)
    assert (drawn.known_m == again.known_m).all()


def test_pixels_keep_their_distance_to_the_grounds_border_not_to_the_images() -> None:
    """4 of 112 rows are the paper's 10 of 256; the ground goes on below the image."""
    shown = ALL.copy()
    shown[:, 100:] = False
    rows, columns = pixels(shown, draws=100)
    assert (columns.min(), columns.max(), rows.max()) == (0, 95, 111)


def test_far_ground_and_impossible_predictions_are_left_out() -> None:
    sound = ~ALL
    sound[:60, 112:] = True
    rows, columns = pixels(sound=sound)
    assert columns.min() >= 112
    assert rows.max() < 60
    assert sample(predicted(), max_range_m=4.0).known_m.max() <= 4.0


@pytest.mark.parametrize("rows", [0, 8])
def test_too_little_ground_is_no_sample(rows: int) -> None:
    """A strip that is narrower than twice the margin has no inner pixels."""
    shown = ~ALL
    shown[50 : 50 + rows] = True
    assert sample_ground(predicted(), shown, GROUND_M, np.random.default_rng(4)) is None


# --- the adaptive scale ---------------------------------------------------------------------------


def confidence(
    given: GroundSample | None, at_s: float = 0.0, estimator: AdaptiveScale | None = None
) -> float:
    return (estimator or AdaptiveScale())(given, at_s).confidence.value


def test_the_adaptive_scale_follows_a_network_whose_unit_changes() -> None:
    """The network's unit halves: a second later the scale has doubled."""
    estimator = AdaptiveScale()
    for frame in range(40):
        scale = estimator(sample(predicted(2.0 if frame < 30 else 4.0)), 0.1 * frame)
    assert (scale.factor, scale.shift_m) == (pytest.approx(4.0, rel=0.01), 0.0)


def test_without_ground_the_scale_carries_on_for_a_while_and_then_is_none() -> None:
    estimator = AdaptiveScale()
    assert estimator(None, 0.0) is None
    first = estimator(sample(predicted()), 0.1)
    carried = estimator(None, 0.6)
    assert carried.factor == pytest.approx(first.factor)
    assert carried.confidence.value < 0.5 < first.confidence.value
    assert estimator(None, 60.0) is None


def test_a_frame_that_disagrees_leaves_the_scale_and_lowers_its_confidence() -> None:
    estimator = AdaptiveScale()
    first = estimator(sample(predicted(2.0)), 0.0)
    other = estimator(sample(predicted(4.0)), 0.1)
    assert other.factor == pytest.approx(first.factor)
    assert other.confidence.value < 0.5 < first.confidence.value
    assert "with which this one disagrees" in other.confidence.reason


def test_a_doubtful_scale_is_no_surer_when_it_is_carried_on() -> None:
    estimator = AdaptiveScale()
    first = confidence(sample(np.full((112, 224), 1.5, dtype=np.float32)), 0.0, estimator)
    assert confidence(None, 0.1, estimator) < first < 0.5


# --- the filter -----------------------------------------------------------------------------------


def test_an_outlier_is_rejected_and_a_new_level_is_believed_in_the_end() -> None:
    smooth = ScaleFilter()
    assert all(smooth.update(0.0, 0.01, 0.1 * frame) for frame in range(10))
    assert not smooth.update(0.6, 0.01, 1.0)
    assert smooth.at(1.0)[0] == pytest.approx(0.0, abs=0.01)
    taken = [smooth.update(0.6, 0.01, 1.1 + 0.1 * frame) for frame in range(6)]
    assert taken == [False] * 4 + [True, True]
    assert smooth.at(1.6)[0] == pytest.approx(0.6, abs=0.01)


def test_doubt_grows_with_time_until_there_is_no_scale_and_never_backwards() -> None:
    smooth = ScaleFilter()
    assert smooth.at(0.0) is None
    smooth.update(0.2, 0.01, 0.0)
    certain, later = smooth.at(0.0), smooth.at(4.0)
    assert certain[1] > later[1] > 0.0
    assert smooth.at(1.0) == later
    assert smooth.at(10.0) is None


def test_a_restart_with_an_old_sample_does_not_turn_time_back() -> None:
    smooth = ScaleFilter()
    for frame in range(5):
        smooth.update(0.0, 0.01, 10.0 + 0.1 * frame)
    for frame in range(5):
        assert not smooth.update(0.6, 0.01, 10.5 + 0.1 * frame)
    assert smooth.update(0.6, 0.01, 9.0)
    restarted = smooth.at(9.0)
    assert smooth.at(10.9) == restarted
