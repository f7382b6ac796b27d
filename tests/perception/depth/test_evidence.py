"""Confidence of a scale: what each measure of the ground says, and all of them together."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.depth.confidence import Confidence, Confidences
from perception.depth.evidence import (
    COEFFICIENTS,
    COEFFICIENTS_IN_HEIGHTS,
    GroundMeasures,
    evidence,
    flow_confidence,
    ground_confidence,
    scale_confidence,
)
from uav_bt.types.arrays import Floats32

RANGES_M = np.linspace(1.2, 4.0, 50).astype(np.float32)


def measures(
    predicted: Floats32, known_m: Floats32 = RANGES_M, share: float = 0.4
) -> GroundMeasures:
    return GroundMeasures.of(known_m, np.asarray(predicted, dtype=np.float32), share)


def confidence(of: GroundMeasures, innovation: float | None = None) -> Confidence:
    return scale_confidence(evidence(of, innovation))


def value(of: GroundMeasures, innovation: float | None = None) -> float:
    found = confidence(of, innovation).value
    assert found is not None
    return found


GROUND = measures(RANGES_M / 2.0)


def test_depth_that_follows_the_plane_is_believed_without_a_reason() -> None:
    assert math.exp(GROUND.log_scale) == pytest.approx(2.0)
    assert (GROUND.spread, GROUND.slope, GROUND.residual) == pytest.approx(
        (0.0, 0.0, 0.0), abs=1e-6
    )
    found = confidence(GROUND, 0.0)
    assert found.value is not None
    assert found.value > 0.8
    assert found.reason == ""
    assert set(found.measures) == set(COEFFICIENTS)
    assert all(each.reason for each in found.measures.values())


def test_a_wall_called_ground_has_a_slope_of_one() -> None:
    wall = measures(np.full(50, 1.5))
    assert wall.slope == pytest.approx(1.0, abs=0.01)
    assert value(wall) < 0.3
    assert "1.00: 0 on ground, 1 on a wall" in str(evidence(wall, None)["slope"].reason)


def test_a_narrow_strip_of_a_wall_is_not_taken_for_ground() -> None:
    """Its ranges hardly differ, and noise hides the slope."""
    rng = np.random.default_rng(0)
    strip = np.linspace(2.0, 2.1, 50).astype(np.float32)
    wall = measures(1.5 * rng.lognormal(0.0, 0.03, 50), strip, share=0.03)
    assert wall.spread < 0.05
    assert value(wall) < 0.3
    extent = evidence(wall, None)["extent"]
    assert extent.value == pytest.approx(0.3 * wall.span / 0.25)
    assert extent.reason.startswith("ground in 3 % of the pixels that can show it")


@pytest.mark.parametrize(
    ("worse", "name"),
    [
        (measures(RANGES_M * np.random.default_rng(1).lognormal(0.0, 0.3, 50)), "spread"),
        (measures(RANGES_M**0.7), "slope"),
        (measures(RANGES_M * np.random.default_rng(1).lognormal(0.0, 0.05, 50)), "residual"),
        (measures(RANGES_M, share=0.02), "extent"),
    ],
)
def test_each_fault_lowers_its_measure_and_the_confidence(worse: GroundMeasures, name: str) -> None:
    best, found = evidence(GROUND, None)[name].value, evidence(worse, None)[name].value
    assert best is not None
    assert found is not None
    assert found < 0.5 < best
    assert value(worse) < value(GROUND)


def test_a_scale_that_agrees_with_earlier_frames_is_believed_more() -> None:
    assert value(GROUND, 0.3) < value(GROUND, None) < value(GROUND, 0.0)
    assert "35 %" in evidence(GROUND, 0.3)["history"].reason
    assert "35 %" in evidence(GROUND, -0.3)["history"].reason


def test_a_wrong_height_is_not_seen_in_depth_of_another_unit() -> None:
    high = measures(RANGES_M / 2.0, 1.5 * RANGES_M)
    assert value(high) == pytest.approx(value(GROUND))


@pytest.mark.parametrize("height_m", [1.4, 2.9])
def test_depth_in_heights_shows_a_wrong_height(height_m: float) -> None:
    """The ground gives a scale of 2 m; a right height is 2 m, too."""
    right, wrong = (scale_confidence(evidence(GROUND, 0.0, height)) for height in (2.0, height_m))
    assert right.value is not None
    assert wrong.value is not None
    assert wrong.value < 0.5 < right.value
    assert "from the height" in wrong.reason
    assert right.measures["height"].value == pytest.approx(1.0)


def test_the_ground_is_judged_by_its_extent_and_as_a_plane() -> None:
    assert ground_confidence(GROUND).value == pytest.approx(1.0)
    wall, patch = measures(np.full(50, 1.5)), measures(RANGES_M, share=0.01)
    for bad, words in ((wall, "1 on a wall"), (patch, "ground in 1 %")):
        found = ground_confidence(bad)
        assert found.value is not None
        assert found.value < 0.2
        assert words in found.reason


def test_equal_ranges_are_no_error() -> None:
    one = measures(np.full(50, 1.0), np.full(50, 2.0, dtype=np.float32))
    assert math.exp(one.log_scale) == pytest.approx(2.0)
    assert one.span == 0.0
    assert math.isfinite(value(one))


def test_no_measure_speaks_against_the_scale_when_it_is_good() -> None:
    assert all(weight >= 0.0 for weight in COEFFICIENTS.values())
    assert list(evidence(GROUND, None)) == list(COEFFICIENTS)
    assert all(weight >= 0.0 for weight in COEFFICIENTS_IN_HEIGHTS.values())
    assert list(evidence(GROUND, None, 2.0)) == list(COEFFICIENTS_IN_HEIGHTS)


def test_ground_that_passes_as_telemetry_reports_is_certain() -> None:
    assert flow_confidence(1.0).value == pytest.approx(1.0)


@pytest.mark.parametrize("stretch", [1.2, 1.0 / 1.2])
def test_a_motion_that_is_a_fifth_off_is_a_half(stretch: float) -> None:
    assert flow_confidence(stretch).value == pytest.approx(0.5)


@pytest.mark.parametrize("stretch", [-0.5, 0.0, 0.3, 4.0])
def test_a_motion_that_is_wrong_by_a_factor_is_no_evidence(stretch: float) -> None:
    found = flow_confidence(stretch)
    assert found.value is not None
    assert found.value < 0.05
    assert f"{stretch:.2f} times as fast" in found.reason


def test_a_further_measure_limits_ground_and_depth_but_not_the_scale() -> None:
    sure = Confidence(value=0.9, measures={"extent": Confidence(value=0.9)})
    given = Confidences(ground=sure, scale=sure, depth=sure)
    flow = Confidence(value=0.2, reason="the ground passes too fast")

    found = given.limited("flow", flow)

    assert (found.ground.value, found.scale.value, found.depth.value) == (0.2, 0.9, 0.2)
    assert found.depth.reason == "the ground passes too fast"
    assert set(found.ground.measures) == {"extent", "flow"}


def test_a_further_measure_that_agrees_changes_no_value() -> None:
    given = Confidences(depth=Confidence(value=0.3, reason="little ground"))
    found = given.limited("flow", Confidence(value=0.8, reason="fast"))

    assert (found.depth.value, found.depth.reason) == (0.3, "little ground")
    assert found.ground.value is None
