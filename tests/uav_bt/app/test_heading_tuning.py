"""Tuning of the heading loop: identification, margins, and recorded flights of the twin."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from behaviours.fly.heading_control import HeadingGains
from tests.worlds.cli import HOP, run
from tests.worlds.trees import document
from uav_bt import app
from uav_bt.board import STATE
from uav_bt.errors import InputError
from uav_bt.tree import Leaf, NodeRegistry, Status
from uav_bt.types import Velocity

pytestmark = pytest.mark.flight

TICK_S = 0.1
TIMES_S = np.arange(0.0, 12.0, TICK_S)
SQUARE_RADPS = np.where((TIMES_S // 1.0) % 2 == 0, 0.4, -0.4)  # turns of 23 degrees to and fro


def exact_yaws(delay_s: float, lag_s: float, gain: float) -> np.ndarray:
    """Return the headings after the square wave, rad: a sum of ramps behind delay and lag."""
    changes = np.diff(SQUARE_RADPS, prepend=0.0)
    elapsed = np.maximum(TIMES_S[:, None] - TIMES_S - delay_s, 0.0)
    return gain * (elapsed + lag_s * np.expm1(-elapsed / max(lag_s, 1e-9))) @ changes


# --- identification -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("delay_s", "lag_s", "gain", "noise_rad"),
    [(0.31, 0.25, 0.8, 0.0), (0.0, 0.4, 1.3, 0.0), (0.15, 0.0, 1.0, 0.0), (0.2, 0.1, 1.0, 0.015)],
)
def test_the_response_of_a_series_is_found(
    delay_s: float, lag_s: float, gain: float, noise_rad: float
) -> None:
    """Also in the noise of a compass, that of the twin's harsh profile."""
    from uav_bt.app.heading_tuning import identify

    noise = np.random.default_rng(5).normal(0.0, noise_rad, TIMES_S.size)
    yaws_rad = 3.0 + exact_yaws(delay_s, lag_s, gain) + noise
    found, residual_rad = identify([np.stack([TIMES_S, SQUARE_RADPS, yaws_rad])])
    near = 0.006 if noise_rad == 0.0 else 0.025
    assert found.delay_s + found.lag_s == pytest.approx(delay_s + lag_s, abs=near)
    assert found.gain == pytest.approx(gain, abs=0.03)
    assert residual_rad == pytest.approx(noise_rad, abs=0.002)
    if noise_rad == 0.0:
        assert found.delay_s == pytest.approx(delay_s, abs=near)


def test_a_series_that_shows_no_response_is_refused() -> None:
    """It turns the other way, or too little: three seconds at 0.4 rad/s are 69 degrees of 90."""
    from uav_bt.app.heading_tuning import identify

    yaws_rad = exact_yaws(0.1, 0.1, 1.0)
    with pytest.raises(InputError, match="expected a heading that follows the commands"):
        identify([np.stack([TIMES_S, SQUARE_RADPS, -yaws_rad])])
    with pytest.raises(InputError, match=r"expected turns of 90 degrees .* got 69: record"):
        identify([np.stack([TIMES_S, SQUARE_RADPS, yaws_rad])[:, :31]])


# --- margins --------------------------------------------------------------------------------------


@pytest.mark.parametrize("delay_ticks", [0, 1, 3])
@pytest.mark.parametrize("gain", [0.5, 1.6])
def test_margins_of_a_delayed_integrator(delay_ticks: int, gain: float) -> None:
    """A sampled integrator with delay under P control has margins in closed form.

    L(z) = k z^-d / (z - 1) with k = gain * tick: at z = exp(i w) its modulus is k / (2 sin(w / 2))
    and its phase -(pi / 2 + w / 2 + d w).
    """
    from uav_bt.app.heading_tuning import YawResponse, heading_loop

    k = gain * TICK_S
    crossover = 2 * math.asin(k / 2)
    phase_margin = math.pi / 2 - crossover * (0.5 + delay_ticks)
    turning_point = math.pi / (1 + 2 * delay_ticks)
    gain_margin = 2 * math.sin(turning_point / 2) / k
    found = heading_loop(
        HeadingGains(proportional=gain, integral=0.0, derivative=0.0),
        YawResponse(delay_s=delay_ticks * TICK_S, lag_s=0.0, gain=1.0),
        TICK_S,
    )
    assert found.crossover_radps == pytest.approx(crossover / TICK_S, rel=1e-3)
    assert found.phase_margin_deg == pytest.approx(math.degrees(phase_margin), abs=0.06)
    assert found.gain_margin_db == pytest.approx(20 * math.log10(gain_margin), abs=0.02)


def test_margins_of_a_fast_loop_approach_the_continuous_ones() -> None:
    """At a tick of 1 ms, delay, lag and PID give the margins of the continuous loop."""
    from uav_bt.app.heading_tuning import YawResponse, heading_loop

    gains = HeadingGains(proportional=2.0, integral=0.3, derivative=0.2)
    omega = np.geomspace(0.1, 50.0, 200_000)
    s = 1j * omega
    loop = (2.0 + 0.3 / s + 0.2 * s) * 1.1 * np.exp(-0.123 * s) / (s * (0.2 * s + 1.0))
    modulus, phase = np.abs(loop), np.unwrap(np.angle(loop))
    crossing, reversal = int(np.argmax(modulus < 1.0)), int(np.argmax(phase < -math.pi))
    found = heading_loop(gains, YawResponse(delay_s=0.123, lag_s=0.2, gain=1.1), 0.001)
    assert found.crossover_radps == pytest.approx(omega[crossing], rel=0.01)
    assert found.phase_margin_deg == pytest.approx(180 + math.degrees(phase[crossing]), abs=0.6)
    assert found.gain_margin_db == pytest.approx(-20 * math.log10(modulus[reversal]), abs=0.1)


def test_suggested_gains_are_the_fastest_with_margins() -> None:
    """A tenth more would lose 6 dB or 45 degrees, and the gains keep their proportions."""
    from uav_bt.app.heading_tuning import YawResponse, heading_loop, suggested_loop

    response = YawResponse(delay_s=0.3, lag_s=0.1, gain=1.0)
    found = suggested_loop(response, TICK_S)
    gains, shipped = found.gains, HeadingGains()
    share = (gains.proportional + 0.1) / shipped.proportional
    more = HeadingGains(
        proportional=gains.proportional + 0.1,
        integral=shipped.integral * share,
        derivative=shipped.derivative * share,
    )
    faster = heading_loop(more, response, TICK_S)
    assert found.gain_margin_db >= 6.0
    assert found.phase_margin_deg >= 45.0
    assert faster.gain_margin_db < 6.0 or faster.phase_margin_deg < 45.0
    assert gains.integral / gains.proportional == pytest.approx(0.1 / 1.2)
    with pytest.raises(InputError, match=r"some gain can steer, got YawResponse\(delay_s=0.8"):
        suggested_loop(YawResponse(delay_s=0.8, lag_s=0.8, gain=40.0), TICK_S)


# --- recorded flights -----------------------------------------------------------------------------


class Swing(Leaf):
    """Turn to and fro at 0.4 rad/s, 1.1 s each way, for 13 s.

    Telemetry comes every 0.2 s: turns of 1 s would always begin at the same age of the telemetry.
    """

    reads = (STATE,)

    def initialise(self) -> None:
        self._ticks = 0

    def update(self) -> Status:
        if self._ticks == 132:
            return Status.SUCCESS
        sign = 1.0 if self._ticks // 11 % 2 == 0 else -1.0
        self.propose(Velocity(yaw_rate_radps=0.4 * sign))
        self._ticks += 1
        return Status.RUNNING


def test_shipped_gains_keep_their_margins_on_the_twin(tmp_path: Path) -> None:
    """6 dB and 45 degrees or more on the response of two flights.

    The flights differ in the age of the telemetry at the ticks.
    """
    from uav_bt.app.heading_tuning import heading_loop, identify, yaw_series

    text = document(HOP.replace("<Land/>", '<HoverFor seconds="1"/><Swing/><Land/>'))
    registry, records = NodeRegistry.installed().with_nodes(Swing), list[Path]()
    for seed in (9, 10):
        records.append(tmp_path / f"{seed}.mcap")
        options = app.FlightOptions(drone="plain", profile="harsh", seed=seed, record=records[-1])
        app.fly(text, options, registry=registry)
    response, _ = identify([one for record in records for one in yaw_series(record)])
    assert 0.15 < response.delay_s + response.lag_s < 0.6
    assert response.gain == pytest.approx(1.1, abs=0.15)
    loop = heading_loop(HeadingGains(), response, TICK_S)
    assert loop.gain_margin_db >= 6.0
    assert loop.phase_margin_deg >= 45.0
    out = tmp_path / "heading.png"
    result = run("lab", "tune-heading", records[0], "--out", out)
    assert result.exit_code == 0, result.output
    assert "commands every 0.10 s" in result.stdout
    assert "shipped gains: P 1.20 1/s" in result.stdout
    assert "suggested gains: P" in result.stdout
    assert out.read_bytes().startswith(b"\x89PNG")
