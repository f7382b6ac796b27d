"""The error of telemetry's velocity: learned where it is large, taken for none where small."""

from __future__ import annotations

import numpy as np
import pytest

from perception.odometry.velocity_error import VelocityError

STEP_S = 0.1


def learned(
    true_mps: float, seconds: float, *, noise_mps: float = 0.03, spread_m: float = 0.6
) -> VelocityError:
    error, noise = VelocityError(), np.random.default_rng(2).normal(0.0, noise_mps, (600, 2))
    for wrong in noise[: round(seconds / STEP_S)]:
        error.predict(STEP_S)
        error.correct(np.array([true_mps, 0.0]) + wrong, STEP_S, spread_m)
    return error


def test_a_large_error_is_learned_within_some_seconds() -> None:
    assert learned(0.2, 4.0).mps == pytest.approx([0.2, 0.0], abs=0.02)


def test_noise_is_no_error() -> None:
    assert np.hypot(*learned(0.0, 20.0).mps) < 0.005


def test_an_error_that_is_not_seen_is_forgotten() -> None:
    error = learned(0.2, 10.0)
    error.predict(120.0)
    assert error.mps == pytest.approx([0.0, 0.0])


def test_a_small_patch_of_ground_teaches_slowly() -> None:
    wide, small = (float(learned(0.2, 0.5, spread_m=spread_m).mps[0]) for spread_m in (0.6, 0.3))
    assert small < 0.5 * wide
