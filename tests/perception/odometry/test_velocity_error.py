"""The error of telemetry's velocity: learned where it is large, taken for none where small."""

from __future__ import annotations

import math

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
