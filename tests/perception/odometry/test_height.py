"""The height that two frames are compared by: smooth, and right in the long run."""

from __future__ import annotations

import numpy as np
import pytest

from perception.odometry.height import SmoothHeight
from uav_bt.types import BodyVelocity, DroneState, FlyingState, Frame


def state(time_s: float, down_mps: float = 0.0) -> DroneState:
    return DroneState(
        captured_s=time_s, flying=FlyingState.FLYING, velocity=BodyVelocity(down_mps=down_mps)
    )


def frame(time_s: float, height_m: float) -> Frame:
    image = np.zeros((9, 16, 3), dtype=np.uint8)
    return Frame(
        image=image,
        index=round(10 * time_s),
        captured_s=time_s,
        gimbal_pitch_rad=0.0,
        height_above_carpet_m=height_m,
    )


def test_the_altimeter_s_noise_is_smoothed() -> None:
    height, noise = SmoothHeight(), np.random.default_rng(1).normal(0.0, 0.03, 60)
    seen = []
    for step, wrong_m in enumerate(noise):
        height.predict(state(0.1 * step))
        seen.append(height.see(frame(0.1 * step, 1.5 + wrong_m)))

    assert np.std(np.diff(seen)) < 0.1 * np.std(np.diff(noise))
    assert seen[-1] == pytest.approx(1.5, abs=0.02)


def test_a_climb_is_followed_at_once_also_by_frames_that_come_late() -> None:
    height = SmoothHeight()
    for step in range(20):
        time_s = 0.1 * step
        height.predict(state(time_s, down_mps=-0.5))
        captured_s = max(0.0, time_s - 0.3)
        assert height.see(frame(captured_s, 1.0 + 0.5 * captured_s)) == pytest.approx(
            1.0 + 0.5 * captured_s
        )


def test_a_wrong_velocity_does_not_lead_far_away() -> None:
    height = SmoothHeight()
    for step in range(100):
        height.predict(state(0.1 * step, down_mps=0.1))
        seen_m = height.see(frame(0.1 * step, 1.5))

    assert seen_m == pytest.approx(1.4, abs=0.02)


def test_samples_that_cannot_be_are_left_out() -> None:
    height = SmoothHeight()
    for sample in (state(0.0), state(1.0, float("nan")), state(float("nan"), 1.0), state(0.0, 5.0)):
        height.predict(sample)

    assert height.see(frame(1.0, 1.5)) == 1.5
    assert SmoothHeight().see(frame(1.0, 1.5)) == 1.5
