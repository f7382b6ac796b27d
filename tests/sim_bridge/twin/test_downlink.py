"""The twin's telemetry: each quantity has a rate and a delay."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import astuple, replace
from itertools import pairwise

import pytest

from sim_bridge.twin.downlink import Downlink, Events
from sim_bridge.twin.drone import TwinDrone
from sim_bridge.twin.profile import Profile
from sim_bridge.twin.sensors import Telemetry
from uav_bt.types import Attitude, BodyVelocity, DroneState, FlyingState, MeasurementTimes

MakeTwin = Callable[..., TwinDrone]
STEP_S = 0.01
HOVERING = Events(flying=FlyingState.HOVERING, movement=None)


def measured(value: float) -> Telemetry:
    return Telemetry(
        attitude=Attitude(yaw_rad=value),
        velocity=BodyVelocity(forward_mps=value),
        altitude_m=value,
        height_m=value,
        height_above_ground_m=value,
    )


def states(drone: TwinDrone, last_s: float) -> list[tuple[float, DroneState]]:
    """Return time and state of each control step."""
    found = []
    while drone.clock.now() < last_s:
        drone.clock.sleep_until(drone.clock.now() + STEP_S)
        found.append((drone.clock.now(), drone.observe().state))
    return found


@pytest.mark.parametrize(("profile", "delay_s"), [("lab", 0.06), ("harsh", 0.12)])
def test_a_new_state_comes_five_times_a_second_and_late(
    make_twin: MakeTwin, profile: str, delay_s: float
) -> None:
    flown = states(make_twin(profile=profile), 3.0)
    arrived = [
        (now_s, state)
        for (_, before), (now_s, state) in pairwise(flown)
        if state.times != before.times
    ]
    assert len(arrived) == pytest.approx(15, abs=1)
    for now_s, state in arrived:
        ages_s = [now_s - time_s for time_s in astuple(state.times)]
        assert ages_s == pytest.approx([delay_s] * 5)
    for now_s, state in flown[30:]:
        assert delay_s - 1e-6 <= now_s - state.captured_s < delay_s + 0.2


def test_values_change_only_when_a_report_arrives(make_twin: MakeTwin) -> None:
    flown = states(make_twin(profile="lab"), 2.0)
    assert len({state.attitude for _, state in flown}) <= 11
    assert len({state.velocity for _, state in flown}) <= 11
    assert len({state.altitude_m for _, state in flown}) <= 11


@pytest.mark.parametrize("profile", ["ideal", "lab-instant", "harsh-instant"])
def test_instant_telemetry_is_of_now(make_twin: MakeTwin, profile: str) -> None:
    for now_s, state in states(make_twin(profile=profile), 0.3):
        assert state.times == MeasurementTimes.all_at(pytest.approx(now_s))


def test_the_same_seed_reports_at_the_same_times_and_another_at_others(
    make_twin: MakeTwin,
) -> None:
    def arrivals(seed: int) -> list[float]:
        return [state.captured_s for _, state in states(make_twin(profile="lab", seed=seed), 1.0)]

    assert arrivals(3) == arrivals(3)
    assert arrivals(3) != arrivals(4)


def test_each_quantity_has_its_own_rate_and_delay() -> None:
    """Velocity every 0.2 s with a delay of 0.05 s, all other quantities at once."""
    profile = replace(Profile.named("lab-instant"), velocity_period_s=0.2, velocity_latency_s=0.05)
    downlink = Downlink(profile, seed=0)
    for step in range(101):
        downlink.take(measured(float(step)), 0.0, HOVERING, step * STEP_S)
    heard = downlink.heard
    assert heard.attitude.yaw_rad == heard.altitude_m == 100.0
    assert heard.times.attitude_s == pytest.approx(1.0)
    assert 0.05 - 1e-6 <= 1.0 - heard.times.velocity_s < 0.25
    assert heard.velocity.forward_mps == pytest.approx(heard.times.velocity_s / STEP_S)


def test_a_changed_flying_state_is_heard_after_its_delay() -> None:
    downlink = Downlink(Profile.named("lab"), seed=0)
    landed = replace(HOVERING, flying=FlyingState.LANDED)
    for step in range(20):
        downlink.take(measured(0.0), 0.0, landed if step < 10 else HOVERING, step * STEP_S)
        late = step * STEP_S < 0.1 + 0.06 - 1e-6
        assert downlink.heard.events.flying is (
            FlyingState.LANDED if late else FlyingState.HOVERING
        )


def test_everything_is_known_at_the_first_step() -> None:
    downlink = Downlink(Profile.named("harsh"), seed=0)
    downlink.take(measured(1.0), -0.5, HOVERING, 0.0)
    heard = downlink.heard
    assert heard.times == MeasurementTimes.all_at(0.0)
    assert (heard.attitude.yaw_rad, heard.gimbal_pitch_rad) == (1.0, -0.5)
