"""Filters of the heading, of the velocity's error and of the factor between displacements."""

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


def test_the_heading_follows_telemetry_where_no_ground_is_seen() -> None:
    for told_rad, turned_rad, yaw_rad in (
        # Without ground telemetry leads.
        ([math.remainder(0.1 * step, 2.0 * math.pi) for step in range(50)], [None] * 50, 4.9),
        # A leap of telemetry is its error.
        ([0.0] * 10 + [1.57] * 10, [None] + [0.0] * 19, 0.0),
        # Looking beyond the ground the drone turns by a right angle; then the ground is back.
        ([0.1 * min(step, 15) for step in range(26)], [None] * 16 + [0.0] * 10, 1.5),
    ):
        heading = Heading()
        for told, turned in zip(told_rad, turned_rad, strict=True):
            heading.see(told, turned, STEP_S)
        for known_rad in (heading.yaw_rad, told_rad[-1] + heading.correction_rad):
            off_rad = math.remainder(known_rad - yaw_rad, 2.0 * math.pi)
            assert off_rad == pytest.approx(0.0, abs=0.01)


def learned(true_mps: float, seconds: float, *, spread_m: float = 0.6) -> VelocityError:
    error, noise = VelocityError(), np.random.default_rng(2).normal(0.0, 0.03, (600, 2))
    for wrong in noise[: round(seconds / STEP_S)]:
        error.predict(STEP_S)
        error.correct(np.array([true_mps, 0.0]) + wrong, STEP_S, spread_m, 0.0)
    return error


def test_an_error_is_learned_slowly_on_little_ground_and_forgotten_unseen() -> None:
    assert np.hypot(*learned(0.0, 20.0).mps(0.0)) < 0.005  # noise is none
    assert learned(0.2, 4.0).mps(0.0) == pytest.approx([0.2, 0.0], abs=0.02)
    wide, small = (learned(0.2, 0.5, spread_m=each).mps(0.0)[0] for each in (0.6, 0.3))
    assert small < 0.5 * wide
    error = learned(0.2, 10.0)
    # Before a turn it counts half as a bias and half as a drift.
    assert error.bias_mps(0.0) == pytest.approx([0.1, 0.0], abs=0.02)
    error.predict(120.0)
    assert error.mps(0.0) == pytest.approx([0.0, 0.0])


@pytest.mark.parametrize(("turns", "expected"), [(1.0, [-0.2, 0.0]), (0.0, [0.2, 0.0])])
def test_a_turn_tells_a_bias_from_a_drift(turns: float, expected: list[float]) -> None:
    """The drone sees the ground during the first quarter of a turn, and none in the second."""
    error = VelocityError()
    for step in range(60):
        yaw_rad = math.radians(90) * max(0, step - 30) / 30
        along = np.array([math.cos(turns * yaw_rad), math.sin(turns * yaw_rad)])
        error.predict(STEP_S)
        error.correct(0.2 * along, STEP_S, 0.6, yaw_rad)
    error.predict(3.0)
    assert error.mps(math.radians(180)) == pytest.approx(expected, abs=0.07)


def test_one_wrong_motion_is_left_out_and_many_are_believed() -> None:
    error = learned(0.0, 10.0)
    error.correct(np.array([0.9, -0.5]), STEP_S, 0.6, 0.0)
    assert np.hypot(*error.mps(0.0)) < 0.01
    for _ in range(40):
        error.predict(STEP_S)
        error.correct(np.array([0.3, 0.0]), STEP_S, 0.6, 0.0)
    assert error.mps(0.0) == pytest.approx([0.3, 0.0], abs=0.05)


def flown(
    factor: float, seconds: float, *, speed_mps: float = 0.4, drift_mps: float = 0.0
) -> Stretch:
    """Fly to and fro, with the noise of frames and of telemetry."""
    stretch, noise = Stretch(), np.random.default_rng(4)
    for step in range(round(seconds / STEP_S)):
        ahead = speed_mps * math.sin(step * STEP_S)
        aside = 0.5 * speed_mps * math.cos(0.7 * step * STEP_S)
        errors = noise.normal(0.0, 0.03, 4)
        seen = complex(factor * ahead + drift_mps + errors[0], factor * aside + errors[1])
        told = complex(ahead + 0.5 * errors[2], aside + 0.5 * errors[3])
        stretch.add(seen, told, STEP_S)
    return stretch


@pytest.mark.parametrize("factor", [0.5, 0.75, 1.0, 1.5, 2.0])
def test_the_factor_of_all_displacements_is_found(factor: float) -> None:
    assert flown(factor, 12.0).factor == pytest.approx(factor, rel=0.06)


def test_drift_hovering_and_few_or_old_displacements_show_no_factor() -> None:
    assert flown(1.0, 20.0, drift_mps=0.2).factor == pytest.approx(1.0, abs=0.06)
    assert flown(2.0, 60.0, speed_mps=0.02).factor is None
    assert flown(2.0, 0.3).factor is None
    stretch = flown(2.0, 20.0)
    for step in range(1200):
        ahead = 0.4 * math.sin(step * STEP_S)
        stretch.add(complex(ahead), complex(ahead), STEP_S)
    assert stretch.factor == pytest.approx(1.0, abs=0.02)
