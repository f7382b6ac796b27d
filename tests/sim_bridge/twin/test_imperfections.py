"""Errors and delays of the twin: profiles, disturbances, telemetry by radio, and images."""

from __future__ import annotations

from dataclasses import astuple, replace

import numpy as np
import pytest

from sim_bridge.twin.camera import Optics
from sim_bridge.twin.noise import NormalStream, OrnsteinUhlenbeck, child_seed
from sim_bridge.twin.profile import Profile, Report
from sim_bridge.twin.sensors import Downlink
from uav_bt.types import Attitude, BodyVelocity, DroneState, FlyingState

IDEAL, LAB, HARSH = (Profile.named(name) for name in ("ideal", "lab", "harsh"))
GREY = np.full((90, 160, 3), 120, np.uint8)
STEP_S, LANDS_AT = 0.01, 10


def test_profiles_go_from_no_imperfection_to_the_worst() -> None:
    """Ideal has limits, but neither delay nor error; harsh is nowhere better than lab."""
    worse = 0
    for name, lab in vars(LAB).items():
        ideal, harsh = getattr(IDEAL, name), getattr(HARSH, name)
        if isinstance(lab, Report):
            assert ideal == (0.0, 0.0)
            assert harsh.latency_s > lab.latency_s
        elif "_std" in name or name.endswith("latency_s") or name == "blur_sigma_px":
            assert ideal == 0.0
            assert harsh >= lab
            worse += harsh > lab
        else:
            assert ideal == lab == harsh
    assert worse > 10


def test_a_disturbance_has_its_standard_deviation_and_correlation_time() -> None:
    """In the long run: standard deviation 0.5, correlation 1/e after the correlation time."""
    wander = OrnsteinUhlenbeck(NormalStream(child_seed(0, 1)), std=0.5, time_s=1.0, step_s=0.1)
    values = np.array([wander.step() for _ in range(60_000)])
    assert values.std() == pytest.approx(0.5, rel=0.05)
    assert np.corrcoef(values[:-10], values[10:])[0, 1] == pytest.approx(np.exp(-1.0), abs=0.05)
    still = OrnsteinUhlenbeck(NormalStream(child_seed(0, 1)), std=0.0, time_s=1.0, step_s=0.1)
    assert [still.step() for _ in range(5)] == [0.0] * 5


def test_purposes_and_seeds_have_independent_random_numbers() -> None:
    paths = ((0, 1), (0, 2), (1, 1), (0, 1))
    draws = [NormalStream(child_seed(*path)).draw() for path in paths]
    assert len(set(draws)) == 3
    assert draws[0] == draws[3]


def heard_by_step(profile: Profile, steps: int, *, seed: int = 0) -> list[DroneState]:
    """Return what arrives at each step, of which the measurements have the number."""
    downlink, states = Downlink(profile, seed), []
    for step in range(steps):
        measured = DroneState(
            captured_s=step * STEP_S,
            flying=FlyingState.LANDED if step >= LANDS_AT else FlyingState.HOVERING,
            attitude=Attitude(yaw_rad=step),
            velocity=BodyVelocity(forward_mps=step),
            altitude_m=step,
            height_m=step,
            gimbal_pitch_rad=-step,
        )
        downlink.take(measured)
        states.append(downlink.state())
    return states


@pytest.mark.parametrize(("profile", "delay_s"), [(LAB, 0.06), (HARSH, 0.12)])
def test_a_new_state_comes_five_times_a_second_and_late(profile: Profile, delay_s: float) -> None:
    """The first is known at once, a landing after the delay; the seed sets the times."""
    states = heard_by_step(profile, 300)
    assert set(astuple(states[0].times)) == {0.0}
    came = [step for step in range(1, 300) if states[step].times != states[step - 1].times]
    assert len(came) == pytest.approx(15, abs=1)
    for step in came:
        ages_s = [step * STEP_S - time_s for time_s in astuple(states[step].times)]
        assert ages_s == pytest.approx([delay_s] * 5)
    landed = [state.flying is FlyingState.LANDED for state in states]
    assert landed.index(True) == LANDS_AT + round(delay_s / STEP_S)
    same, other = (heard_by_step(profile, 300, seed=seed) for seed in (0, 1))
    assert states == same != other


def test_each_quantity_has_its_own_rate_and_delay() -> None:
    """Velocity every 0.2 s with a delay of 0.05 s, all other quantities at once."""
    last = heard_by_step(replace(IDEAL, velocity=Report(0.2, 0.05)), 101)[-1]
    assert last.attitude.yaw_rad == last.altitude_m == last.height_m == 100
    assert last.gimbal_pitch_rad == -100
    assert last.times.attitude_s == last.times.height_s == pytest.approx(1.0)
    assert 0.05 - 1e-6 <= 1.0 - last.times.velocity_s < 0.25
    assert last.velocity.forward_mps == pytest.approx(last.times.velocity_s / STEP_S)


def test_an_ideal_camera_changes_nothing() -> None:
    """It returns a copy, so that the clean image stays unchanged."""
    result = Optics(IDEAL, 160, 90, 0).degrade(GREY, 3, 1.0)
    assert np.array_equal(result, GREY)
    assert not np.shares_memory(result, GREY)


def test_image_noise_has_the_asked_strength_no_bias_and_no_pattern() -> None:
    """The standard deviation is as configured; frames are independent; a frame is reproducible."""
    optics = Optics(replace(IDEAL, image_noise_std=5.0), 160, 90, 7)
    first, second = (optics.degrade(GREY, k, 1.0).astype(float) - 120 for k in (1, 2))
    assert first.std() == pytest.approx(5.0, rel=0.05)
    assert abs(first.mean()) < 0.1
    assert abs(np.corrcoef(first.ravel(), second.ravel())[0, 1]) < 0.03
    assert np.array_equal(optics.degrade(GREY, 1, 1.0).astype(float) - 120, first)


def test_exposure_scales_and_saturates_and_blur_softens_an_edge() -> None:
    optics = Optics(replace(IDEAL, blur_sigma_px=4.0), 160, 90, 0)
    assert np.all(optics.degrade(GREY, 0, 1.1) == 132)
    assert np.all(optics.degrade(GREY + 100, 0, 2.0) == 255)
    edge = np.zeros((90, 160, 3), np.uint8)
    edge[:, 80:] = 200
    blurred = optics.degrade(edge, 0, 1.0)
    assert np.abs(np.diff(blurred[45, :, 0].astype(int))).max() < 120
    assert blurred.mean() == pytest.approx(edge.mean(), rel=0.01)
