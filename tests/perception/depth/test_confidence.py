"""Confidence of a scale: what each measure of the ground says, and all of them together."""

import math

import numpy as np
import pytest

from perception.depth.confidence import (
    Confidence,
    GroundMeasures,
    evidence,
    flow_measure,
    ground_confidence,
    scale_confidence,
)

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
