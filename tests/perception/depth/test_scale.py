"""The scale of a depth map by the ground plane, and how far it is trusted."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from perception.camera.ground_plane import CameraView, ground_depth
from perception.depth.confidence import (
    Confidence,
    GroundMeasures,
    Measure,
    evidence,
    flow_measure,
    ground_confidence,
    scale_confidence,
)
from perception.depth.plane_check import agreement_with_plane
from perception.depth.scale import AdaptiveScale, GroundSample, ScaleFilter, sample_ground
from sim_bridge.anafi import anafi_camera
from tests.paper_lab import BACKGROUND, CARPET, paper_map
from tests.worlds import values
from uav_bt.testing import pinhole
from uav_bt.types import DepthMap
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


# --- depth in heights against the plane of the ground ---------------------------------------------

CAMERA = pinhole(640, 360)
SIZE = (224, 112)
HEIGHT_M = 1.5


def agreement(
    *,
    focal: float = 1.0,
    pitch_deg: float = -32.0,
    pitch_off_deg: float = 0.0,
    height_off_m: float = 0.0,
    in_heights: bool = True,
    shown: int = CARPET,
    wall: bool = False,
) -> Measure | None:
    """Return the agreement of exact depth in heights with telemetry and camera as given."""
    pitch_rad, said_rad = math.radians(pitch_deg), math.radians(pitch_deg + pitch_off_deg)
    view = CameraView(camera=CAMERA.resized(*SIZE), pitch_rad=pitch_rad, height_m=HEIGHT_M)
    depth = np.nan_to_num(ground_depth(view), nan=50.0) / np.float32(HEIGHT_M)
    if wall:
        depth = np.full_like(depth, 2.0)
    frame = values.frame((360, 640), said_rad, HEIGHT_M + height_off_m)
    ids = np.full(SIZE[::-1], shown, np.uint8)
    camera = replace(CAMERA, fx_px=focal * CAMERA.fx_px, fy_px=focal * CAMERA.fy_px)
    relative = DepthMap(depth=depth, metric=False, captured_s=0.0, in_heights=in_heights)
    return agreement_with_plane(
        relative, paper_map(ids=ids, captured_s=0.0), frame, camera, np.random.default_rng(1)
    )


@pytest.mark.parametrize(
    ("least", "most", "how"),
    [
        pytest.param(0.9, 1.0, {}, id="right inputs"),
        pytest.param(0.0, 0.3, {"focal": 0.5}, id="half the focal length"),
        pytest.param(0.0, 0.3, {"focal": 2.0}, id="twice the focal length"),
        pytest.param(0.0, 0.15, {"wall": True}, id="a wall that counts as ground"),
        pytest.param(0.0, 0.4, {"pitch_off_deg": 10.0}, id="pitch"),
        pytest.param(0.9, 1.0, {"height_off_m": 0.5}, id="a wrong height does not show"),
    ],
)
def test_what_is_wrong_shows(least: float, most: float, how: dict[str, Any]) -> None:
    found = agreement(**how)
    assert least < found[0] <= most
    assert found[1]


@pytest.mark.parametrize(
    "how",
    [
        pytest.param({"in_heights": False}, id="another unit"),
        pytest.param({"shown": BACKGROUND}, id="no ground"),
        pytest.param({"focal": 0.5, "pitch_deg": -65.0}, id="a steep view"),
        pytest.param({"focal": 0.5, "pitch_deg": -90.0}, id="straight down"),
    ],
)
def test_some_views_say_nothing(how: dict[str, Any]) -> None:
    assert agreement(**how) is None


# --- confidence of a scale ------------------------------------------------------------------------

RANGES_M = np.linspace(1.2, 4.0, 50).astype(np.float32)


def measures(
    predicted: np.ndarray, known_m: np.ndarray = RANGES_M, share: float = 0.4
) -> GroundMeasures:
    return GroundMeasures.of(known_m, np.asarray(predicted, dtype=np.float32), share)


def value(of: GroundMeasures, innovation: float | None = None) -> float:
    return scale_confidence(evidence(of, innovation)).value


GROUND = measures(RANGES_M / 2.0)
WALL = measures(np.full(50, 1.5))


def test_depth_that_follows_the_plane_is_believed_without_a_reason() -> None:
    assert math.exp(GROUND.log_scale) == pytest.approx(2.0)
    assert (GROUND.spread, GROUND.slope, GROUND.residual) == pytest.approx((0, 0, 0), abs=1e-6)
    found = scale_confidence(evidence(GROUND, 0.0))
    assert found.value > 0.8
    assert found.reason == ""
    assert all(words for _, words in found.measures.values())


def test_a_wall_or_a_narrow_strip_of_it_is_not_taken_for_ground() -> None:
    """The ranges of a strip hardly differ, and noise hides the slope."""
    assert pytest.approx(1.0, abs=0.01) == WALL.slope
    assert value(WALL) < 0.3
    assert "1.00: 0 on ground, 1 on a wall" in evidence(WALL, None)["slope"][1]
    rng = np.random.default_rng(0)
    strip = np.linspace(2.0, 2.1, 50).astype(np.float32)
    wall = measures(1.5 * rng.lognormal(0.0, 0.03, 50), strip, share=0.03)
    assert wall.spread < 0.05
    assert value(wall) < 0.3
    extent, words = evidence(wall, None)["extent"]
    assert extent == pytest.approx(0.3 * wall.span / 0.25)
    assert words.startswith("ground in 3 % of the pixels that can show it")


def test_each_fault_lowers_its_measure_and_the_confidence() -> None:
    for worse, name in (
        (measures(RANGES_M * np.random.default_rng(1).lognormal(0.0, 0.3, 50)), "spread"),
        (measures(RANGES_M**0.7), "slope"),
        (measures(RANGES_M * np.random.default_rng(1).lognormal(0.0, 0.05, 50)), "residual"),
        (measures(RANGES_M, share=0.02), "extent"),
    ):
        assert evidence(worse, None)[name][0] < 0.5 < evidence(GROUND, None)[name][0]
        assert value(worse) < value(GROUND)


def test_a_scale_that_agrees_with_earlier_frames_is_believed_more() -> None:
    assert value(GROUND, 0.3) < value(GROUND, None) < value(GROUND, 0.0)
    for innovation in (0.3, -0.3):
        assert "35 %" in evidence(GROUND, innovation)["history"][1]


@pytest.mark.parametrize("height_m", [1.4, 2.9])
def test_only_depth_in_heights_shows_a_wrong_height(height_m: float) -> None:
    """The ground gives a scale of 2 m; a right height is 2 m, too."""
    right, wrong = (scale_confidence(evidence(GROUND, 0.0, height)) for height in (2.0, height_m))
    assert wrong.value < 0.5 < right.value
    assert "from the height" in wrong.reason
    assert right.measures["height"][0] == pytest.approx(1.0)
    assert value(measures(RANGES_M / 2.0, 1.5 * RANGES_M)) == pytest.approx(value(GROUND))


def test_the_ground_is_judged_by_its_extent_and_as_a_plane() -> None:
    for bad, words in ((WALL, "1 on a wall"), (measures(RANGES_M, share=0.01), "ground in 1 %")):
        assert ground_confidence(GROUND).value == pytest.approx(1.0)
        found = ground_confidence(bad)
        assert found.value < 0.2
        assert words in found.reason


def test_equal_ranges_are_no_error() -> None:
    one = measures(np.full(50, 1.0), np.full(50, 2.0, dtype=np.float32))
    assert (math.exp(one.log_scale), one.span) == (pytest.approx(2.0), 0.0)
    assert math.isfinite(value(one))


def test_a_further_measure_lowers_a_confidence_and_never_raises_it() -> None:
    sure = Confidence(0.9, "", {"extent": (0.9, "wide")})
    found = sure.limited("flow", (0.2, "too fast"))
    assert (found.value, found.reason, set(found.measures)) == (0.2, "too fast", {"extent", "flow"})
    found = Confidence(0.3, "little ground").limited("flow", (0.8, "fast"))
    assert (found.value, found.reason, set(found.measures)) == (0.3, "little ground", {"flow"})
    assert Confidence(reason="none").limited("flow", (0.2, "fast")).value is None


def test_a_motion_over_the_ground_that_telemetry_contradicts_says_little() -> None:
    for stretch in (-0.5, 0.0, 0.3, 1 / 1.2, 1.0, 1.2, 4.0):
        found, words = flow_measure(stretch)
        expected = 1.0 if stretch == 1.0 else 0.5 if 0.8 < stretch < 1.3 else 0.0
        assert found == pytest.approx(expected, abs=1e-6 if expected else 0.05)
        assert f"{stretch:.2f} times as fast" in words
