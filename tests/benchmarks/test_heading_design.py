"""Identification, margins and step figures; and the shipped gains on the twin itself."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator

import numpy as np
import pytest

from behaviours.fly.heading_control import HeadingGains
from benchmarks.heading_design import (
    StepResponse,
    YawResponse,
    identify,
    margins,
    step_metrics,
    step_response,
)
from benchmarks.heading_trial import fly_step, hover, record_yaw
from sim_bridge.twin import TwinConfig
from sim_bridge.twin.drone import TwinDrone
from uav_bt.errors import MissingDependencyError, ShapeError, ValueRangeError
from uav_bt.testing import ScriptedDrone

TICK_S = 0.1
TIMES = np.arange(0.0, 12.0, 0.05)
SQUARE = np.where((TIMES // 1.0) % 2 == 0, 0.4, -0.4)


# --- the model ------------------------------------------------------------------------------------


def test_ramp_known_values() -> None:
    """Nothing during the dead time; then the rate builds up; later the heading lags by tau."""
    response = YawResponse(dead_time_s=0.2, lag_s=0.1, gain=2.0)

    assert response.ramp([0.0, 0.2]) == pytest.approx([0.0, 0.0])
    assert response.ramp(0.3) == pytest.approx(2.0 * (0.1 - 0.1 * (1 - math.exp(-1))))
    assert response.ramp(5.2) == pytest.approx(2.0 * (5.0 - 0.1))


def test_ramp_without_lag_is_straight() -> None:
    """Zero lag is no special case for a caller."""
    assert YawResponse(dead_time_s=0.1, lag_s=0.0).ramp([0.05, 0.6]) == pytest.approx([0.0, 0.5])


@pytest.mark.parametrize(
    "bad", [{"dead_time_s": -0.1}, {"lag_s": -0.1}, {"gain": 0.0}, {"lag_s": math.nan}]
)
def test_response_refuses_senseless_values(bad: dict[str, float]) -> None:
    """A response backwards in time or without effect is refused."""
    with pytest.raises(ValueRangeError, match="dead time and lag"):
        YawResponse(**({"dead_time_s": 0.1, "lag_s": 0.1} | bad))


# --- identification -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "truth",
    [
        YawResponse(dead_time_s=0.09, lag_s=0.12, gain=1.0),
        YawResponse(dead_time_s=0.31, lag_s=0.25, gain=0.8),
        YawResponse(dead_time_s=0.0, lag_s=0.4, gain=1.3),
        YawResponse(dead_time_s=0.15, lag_s=0.0, gain=1.0),
    ],
)
def test_identify_recovers_the_parameters(truth: YawResponse) -> None:
    """From a clean recording, wrapped headings included, the parameters come back."""
    yaws = 3.0 + truth.turned(TIMES, SQUARE)
    wrapped = (yaws + math.pi) % (2 * math.pi) - math.pi
    assert np.ptp(wrapped) > 3.0

    found = identify(TIMES, SQUARE, wrapped)

    assert found.dead_time_s == pytest.approx(truth.dead_time_s, abs=0.002)
    assert found.lag_s == pytest.approx(truth.lag_s, abs=0.003)
    assert found.gain == pytest.approx(truth.gain, rel=0.002)


def test_identify_bears_noise() -> None:
    """With the harsh profile's compass noise it is still right to 25 ms and 3 percent."""
    truth = YawResponse(dead_time_s=0.2, lag_s=0.1)
    noise = np.random.default_rng(5).normal(0.0, 0.015, TIMES.size)

    found = identify(TIMES, SQUARE, truth.turned(TIMES, SQUARE) + noise)

    assert found.dead_time_s + found.lag_s == pytest.approx(0.3, abs=0.025)
    assert found.gain == pytest.approx(1.0, abs=0.03)


def test_identify_refuses_a_drone_that_turns_the_other_way() -> None:
    """A wrong sign is not hidden in a negative gain."""
    yaws = YawResponse(dead_time_s=0.1, lag_s=0.1).turned(TIMES, SQUARE)

    with pytest.raises(ValueRangeError, match="does not follow"):
        identify(TIMES, SQUARE, -yaws)


def test_identify_refuses_useless_recordings() -> None:
    """Arrays of different lengths, too few samples and no command are told apart."""
    with pytest.raises(ShapeError, match="yaws must be N, as the 240 times, got 239"):
        identify(TIMES, SQUARE, TIMES[1:])
    with pytest.raises(ValueRangeError, match="10 samples"):
        identify(TIMES[:5], SQUARE[:5], TIMES[:5])
    with pytest.raises(ValueRangeError, match="not 0"):
        identify(TIMES, 0.0 * SQUARE, TIMES)


# --- margins --------------------------------------------------------------------------------------


@pytest.mark.parametrize("delay_ticks", [0, 1, 3])
@pytest.mark.parametrize("gain", [0.5, 1.6])
def test_margins_of_a_delayed_integrator(delay_ticks: int, gain: float) -> None:
    """A sampled integrator with delay under P control has margins in closed form.

    L(z) = k z^-d / (z - 1) with k = gain * tick: at z = exp(i w) its modulus is k / (2 sin(w / 2))
    and its phase -(pi / 2 + w / 2 + d w).
    """
    k = gain * TICK_S
    crossover = 2 * math.asin(k / 2)
    phase_margin = math.pi / 2 - crossover * (0.5 + delay_ticks)
    turning_point = math.pi / (1 + 2 * delay_ticks)
    gain_margin = 2 * math.sin(turning_point / 2) / k

    found = margins(
        HeadingGains(proportional=gain, integral=0.0, derivative=0.0),
        YawResponse(dead_time_s=delay_ticks * TICK_S, lag_s=0.0),
        TICK_S,
    )

    assert found.crossover_radps == pytest.approx(crossover / TICK_S, rel=1e-3)
    assert found.phase_margin_rad == pytest.approx(phase_margin, abs=1e-3)
    assert found.gain_margin_db == pytest.approx(20 * math.log10(gain_margin), abs=0.02)


def test_margins_of_a_fast_loop_approach_the_continuous_ones() -> None:
    """At a tick of 1 ms, dead time, lag and PID give what the continuous loop gives."""
    gains = HeadingGains(proportional=2.0, integral=0.3, derivative=0.2)
    response = YawResponse(dead_time_s=0.123, lag_s=0.2, gain=1.1)
    omega = np.geomspace(0.1, 50.0, 200_000)
    s = 1j * omega
    loop = (2.0 + 0.3 / s + 0.2 * s) * 1.1 * np.exp(-0.123 * s) / (s * (0.2 * s + 1.0))
    modulus, phase = np.abs(loop), np.unwrap(np.angle(loop))
    crossing = int(np.argmax(modulus < 1.0))
    reversal = int(np.argmax(phase < -math.pi))

    found = margins(gains, response, 0.001)

    assert found.crossover_radps == pytest.approx(omega[crossing], rel=0.01)
    assert found.phase_margin_rad == pytest.approx(math.pi + phase[crossing], abs=0.01)
    assert found.gain_margin_db == pytest.approx(-20 * math.log10(modulus[reversal]), abs=0.1)


@pytest.mark.parametrize("dead_time_s", [0.13, 0.2])
def test_gain_margin_is_where_the_step_response_turns_unstable(dead_time_s: float) -> None:
    """The simulated loop settles a little below the gain margin and swings up a little above."""
    response = YawResponse(dead_time_s=dead_time_s, lag_s=0.1)

    def swing(gain: float) -> float:
        gains = HeadingGains(
            proportional=gain, integral=0.0, derivative=0.0, max_yaw_rate_radps=1e6
        )
        late = step_response(gains, response, step_rad=0.1, duration_s=40.0).yaws_rad[-50:]
        return float(np.ptp(late))

    one = margins(HeadingGains(proportional=1.0, integral=0.0, derivative=0.0), response)
    critical = 10.0 ** (one.gain_margin_db / 20.0)

    assert swing(0.95 * critical) < 0.05
    assert swing(1.05 * critical) > 0.2


def test_margins_without_the_control_package(monkeypatch: pytest.MonkeyPatch) -> None:
    """A missing extra is named with its cure."""
    monkeypatch.setitem(sys.modules, "control", None)
    with pytest.raises(MissingDependencyError, match=r"uav-bt\[design\]"):
        margins(HeadingGains(), YawResponse(dead_time_s=0.1, lag_s=0.1))


# --- step figures ---------------------------------------------------------------------------------


def test_step_metrics_known_values() -> None:
    """Rise, overshoot and settling of a hand-made step, to the left as to the right."""
    times = np.arange(0.0, 1.0, 0.1)
    yaws = np.array([0.0, 0.05, 0.25, 0.85, 0.95, 1.2, 1.1, 0.97, 1.01, 1.0])
    for sign in (1.0, -1.0):
        step = StepResponse(times_s=times, yaws_rad=sign * yaws, commands_radps=0.0 * times)

        figures = step_metrics(step, sign)

        assert figures.rise_time_s == pytest.approx(0.35 - 0.125)
        assert figures.overshoot == pytest.approx(0.2)
        assert figures.settling_time_s == pytest.approx(0.7)


def test_step_metrics_of_a_step_that_never_arrives() -> None:
    """What was not reached is NaN, not a number that looks good."""
    times = np.arange(0.0, 1.0, 0.1)
    step = StepResponse(times_s=times, yaws_rad=0.5 * times, commands_radps=0.0 * times)

    figures = step_metrics(step, 1.0)

    assert math.isnan(figures.rise_time_s)
    assert math.isnan(figures.settling_time_s)
    assert figures.overshoot == 0.0


# --- on a drone -----------------------------------------------------------------------------------


def test_trial_on_a_scripted_drone() -> None:
    """A drone that obeys within its tick is identified as one without dead time or lag."""
    drone = ScriptedDrone()
    drone.connect()
    hover(drone)

    recording = record_yaw(drone, cycles=2, sample_s=TICK_S)
    found = identify(recording.times_s, recording.commands_radps, recording.yaws_rad)

    assert found.dead_time_s + found.lag_s < 0.01
    assert found.gain == pytest.approx(1.0, abs=0.01)


@pytest.fixture(params=["lab", "harsh"])
def flying_twin(request: pytest.FixtureRequest) -> Iterator[TwinDrone]:
    """A twin in a calm hover; its video is tiny, nobody looks at it."""
    profile: str = request.param
    drone = TwinConfig(profile=profile, seed=9, image_size_px=(64, 36)).create()
    drone.connect()
    hover(drone)
    yield drone
    drone.disconnect()


def test_shipped_gains_keep_their_margins_on_the_twin(flying_twin: TwinDrone) -> None:
    """6 dB and 45 degrees or more on the response identified here, and a step that behaves."""
    recording = record_yaw(flying_twin)
    response = identify(recording.times_s, recording.commands_radps, recording.yaws_rad)
    latency_s = flying_twin.profile.compute_latency_s + flying_twin.profile.command_latency_s
    assert response.dead_time_s + response.lag_s > latency_s
    assert response.gain == pytest.approx(1.1, abs=0.15)

    loop = margins(HeadingGains(), response, TICK_S)

    assert loop.gain_margin_db >= 6.0
    assert loop.phase_margin_rad >= math.radians(45)

    step_rad = math.radians(-120)  # across the wrap from most headings
    figures = step_metrics(fly_step(flying_twin, HeadingGains(), step_rad=step_rad), step_rad)
    assert figures.overshoot < 0.05
    assert figures.settling_time_s < 4.0
