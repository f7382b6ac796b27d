"""The factor between displacements by the ground and by telemetry, apart from drift and bias."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.odometry.ground import GroundOdometry
from perception.odometry.stretch import Stretch
from tests.paper_lab import CARPET, paper_map
from tests.worlds import values
from uav_bt.testing import pinhole
from uav_bt.types import BodyVelocity, DroneState, FlyingState, Frame, Pose2D

STEP_S = 0.1


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
            (factor * ahead + drift_mps + errors[0], factor * aside + errors[1]),
            (ahead + 0.5 * errors[2], aside + 0.5 * errors[3]),
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
        stretch.add((ahead, 0.0), (ahead, 0.0), STEP_S)
    assert stretch.factor == pytest.approx(1.0, abs=0.02)


def test_the_odometry_states_the_factor_of_a_wrong_height() -> None:
    """The ground passes 1.5 times as far between two frames as telemetry says."""

    def way_m(time_s: float) -> float:
        return 0.4 - 0.4 * math.cos(time_s)

    def measured(first: Frame, second: Frame) -> Pose2D:
        passed_m = way_m(second.captured_s) - way_m(first.captured_s)
        return Pose2D(x_m=1.5 * passed_m, y_m=0.0, yaw_rad=0.0)

    odometry, camera = GroundOdometry(measure=measured), pinhole(64, 36)
    ids = np.full((18, 32), CARPET, np.uint8)
    image = np.zeros((36, 64, 3), np.uint8)
    for index in range(100):
        time_s = index * STEP_S
        velocity = BodyVelocity(forward_mps=0.4 * math.sin(time_s))
        odometry.predict(
            DroneState(captured_s=time_s, flying=FlyingState.FLYING, velocity=velocity)
        )
        frame = values.frame(image, captured_s=time_s, index=index)
        odometry.see(paper_map(ids=ids, captured_s=time_s), frame, camera)
        if index == 2:
            assert odometry.estimate is not None
            assert odometry.estimate.stretch is None
    assert odometry.estimate is not None
    assert odometry.estimate.stretch == pytest.approx(1.5, abs=0.03)
