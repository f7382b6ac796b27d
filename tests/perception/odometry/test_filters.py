"""Filters of the heading, of the velocity's error and of the factor between displacements."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.odometry.filters import Heading, Stretch, VelocityError

STEP_S = 0.1


def test_telemetry_s_noise_and_slow_error_do_not_turn_it() -> None:
    rng, heading, errors = np.random.default_rng(1), Heading(), []
    for step in range(600):
        true_rad, slow_rad = 0.4 * STEP_S * step, 0.06 * math.sin(step * STEP_S / 20.0)
        noise_rad = rng.normal(0.0, 0.01) if step else 0.0
        turned_rad = 0.4 * STEP_S if step else None
        heading.see(true_rad + slow_rad + noise_rad, turned_rad, STEP_S)
        errors.append(math.remainder(heading.yaw_rad - true_rad, 2.0 * math.pi))
    assert np.abs(errors).max() < 0.035
    assert np.std(np.diff(errors)) < 0.002


def test_without_ground_telemetry_leads() -> None:
    heading = Heading()
    for step in range(50):
        heading.see(math.remainder(0.1 * step, 2.0 * math.pi), None, STEP_S)
    assert math.remainder(heading.yaw_rad - 4.9, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-6)


def test_a_leap_of_telemetry_is_its_error() -> None:
    heading = Heading()
    for step in range(20):
        heading.see(0.0 if step < 10 else 1.57, None if step == 0 else 0.0, STEP_S)
    assert heading.yaw_rad == pytest.approx(0.0, abs=0.01)
    assert 1.57 + heading.correction_rad == pytest.approx(0.0, abs=0.01)


def test_a_turn_that_no_image_showed_is_believed() -> None:
    """Looking beyond the ground the drone turns by a right angle; then the ground is back."""
    heading = Heading()
    for step in range(16):
        heading.see(0.1 * step, None, STEP_S)
    for _ in range(10):
        heading.see(1.5, 0.0, STEP_S)
    assert heading.yaw_rad == pytest.approx(1.5, abs=0.01)


# --- the error of the velocity ---


def learned(
    true_mps: float, seconds: float, *, noise_mps: float = 0.03, spread_m: float = 0.6
) -> VelocityError:
    error, noise = VelocityError(), np.random.default_rng(2).normal(0.0, noise_mps, (600, 2))
    for wrong in noise[: round(seconds / STEP_S)]:
        error.predict(STEP_S)
        error.correct(np.array([true_mps, 0.0]) + wrong, STEP_S, spread_m, 0.0)
    return error


def test_a_large_error_is_learned_within_some_seconds() -> None:
    assert learned(0.2, 4.0).mps(0.0) == pytest.approx([0.2, 0.0], abs=0.02)


def test_noise_is_no_error() -> None:
    assert np.hypot(*learned(0.0, 20.0).mps(0.0)) < 0.005


def test_an_error_that_is_not_seen_is_forgotten() -> None:
    error = learned(0.2, 10.0)
    error.predict(120.0)
    assert error.mps(0.0) == pytest.approx([0.0, 0.0])


def test_a_small_patch_of_ground_teaches_slowly() -> None:
    wide, small = (
        float(learned(0.2, 0.5, spread_m=spread_m).mps(0.0)[0]) for spread_m in (0.6, 0.3)
    )
    assert small < 0.5 * wide


@pytest.mark.parametrize("turns", [True, False], ids=["bias", "drift"])
def test_a_turn_tells_a_bias_from_a_drift(turns: bool) -> None:  # noqa: FBT001
    """The drone sees the ground during the first quarter of a turn, and none in the second."""
    error = VelocityError()
    for step in range(60):
        yaw_rad = math.radians(90) * max(0, step - 30) / 30
        heading = yaw_rad if turns else 0.0
        error.predict(STEP_S)
        error.correct(0.2 * np.array([math.cos(heading), math.sin(heading)]), STEP_S, 0.6, yaw_rad)
    error.predict(3.0)
    expected = [-0.2, 0.0] if turns else [0.2, 0.0]
    assert error.mps(math.radians(180)) == pytest.approx(expected, abs=0.07)


def test_an_error_counts_half_as_either_before_a_turn() -> None:
    error = learned(0.2, 10.0)
    assert error.bias_mps(0.0) == pytest.approx([0.1, 0.0], abs=0.02)


def test_one_wrong_motion_is_left_out_and_many_are_believed() -> None:
    error = learned(0.0, 10.0)
    error.correct(np.array([0.9, -0.5]), STEP_S, 0.6, 0.0)
    assert np.hypot(*error.mps(0.0)) < 0.01
    for _ in range(40):
        error.predict(STEP_S)
        error.correct(np.array([0.3, 0.0]), STEP_S, 0.6, 0.0)
    assert error.mps(0.0) == pytest.approx([0.3, 0.0], abs=0.05)


# --- the stretch ---


def flown(
    factor: float, seconds: float, *, speed_mps: float = 0.4, drift_mps: float = 0.0, seed: int = 4
) -> Stretch:
    """Fly to and fro, with the noise of frames and of telemetry."""
    stretch, noise = Stretch(), np.random.default_rng(seed)
    for step in range(round(seconds / STEP_S)):
        ahead = speed_mps * math.sin(step * STEP_S)
        aside = 0.5 * speed_mps * math.cos(0.7 * step * STEP_S)
        errors = noise.normal(0.0, 0.03, 4)
        stretch.add(
            complex(factor * ahead + drift_mps + errors[0], factor * aside + errors[1]),
            complex(ahead + 0.5 * errors[2], aside + 0.5 * errors[3]),
            STEP_S,
        )
    return stretch


@pytest.mark.parametrize("factor", [0.5, 0.75, 1.0, 1.5, 2.0])
def test_the_factor_of_all_displacements_is_found(factor: float) -> None:
    assert flown(factor, 12.0).factor == pytest.approx(factor, rel=0.06)


def test_a_drift_is_no_factor() -> None:
    assert flown(1.0, 20.0, drift_mps=0.2).factor == pytest.approx(1.0, abs=0.06)


def test_a_drone_that_hovers_shows_no_factor() -> None:
    assert flown(2.0, 60.0, speed_mps=0.02).factor is None


def test_a_few_displacements_are_too_few() -> None:
    assert flown(2.0, 0.3).factor is None


def test_old_displacements_are_forgotten() -> None:
    stretch = flown(2.0, 20.0)
    for step in range(1200):
        ahead = 0.4 * math.sin(step * STEP_S)
        stretch.add(complex(ahead), complex(ahead), STEP_S)
    assert stretch.factor == pytest.approx(1.0, abs=0.02)
