"""The heading: turns that the ground shows, and telemetry where it shows none."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.odometry.heading import Heading

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
