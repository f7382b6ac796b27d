"""Tuning of the heading loop from a recorded flight.

The drone answers a yaw-rate command as a first-order lag behind a delay, and the rate integrates to
the heading; delay, lag and gain are fitted to the record:

    yaw(s) / command(s) = gain * exp(-delay * s) / (s * (lag * s + 1))

The drone holds a command until the next. Sampled at the ticks, drone and hold have an exact
discrete transfer function (Astrom and Wittenmark, *Computer-Controlled Systems*, section 2.6).
Clockwise is positive.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import control
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.optimize import brute, fmin
from scipy.signal import lfilter

from behaviours.fly.heading_control import HeadingGains
from uav_bt.errors import InputError
from uav_bt.files import whole_file
from uav_bt.record.reader import RecordReader
from uav_bt.types import FlyingState, Hover, Velocity

Series = NDArray[np.float64]
"""(3, N): mission time, s; yaw rate sent then, rad/s; heading read then, rad, unwrapped."""

_GAIN_MARGIN_DB, _PHASE_MARGIN_DEG = 6.0, 45.0  # usual least margins
_LEAST_TICKS: Final = 20  # chosen: a shorter series of commands holds no whole response
_LEAST_TURN_DEG: Final = 90.0  # chosen: commanded turns of all series together
_LEAST_FIT: Final = 0.9  # chosen: share of the heading's variance that the model explains
_LONGEST_S: Final = 0.8  # chosen: delay and lag are searched up to this time
_STEP_S: Final = 0.002  # chosen: time step of the simulated response
_PROPORTIONAL: Final = [tenths / 10 for tenths in range(30, 0, -1)]  # 1/s, chosen: those tried


@dataclass(frozen=True, kw_only=True)
class YawResponse:
    """Response of the drone's heading to yaw-rate commands."""

    delay_s: float  # from a command to the first effect that the mission reads
    lag_s: float  # time constant of the yaw rate
    gain: float  # yaw rate reached per yaw rate commanded

    def turned(self, series: Series) -> NDArray[np.float64]:
        """Return the turn that the model predicts since the start of a series, (N,) rad."""
        times, rates, _ = series
        commanded = np.append(0.0, np.cumsum(rates[:-1] * np.diff(times)))
        grid = np.arange(times[0], times[-1] + _STEP_S, _STEP_S)
        delayed = np.interp(grid - self.delay_s, times, commanded)
        keep = math.exp(-_STEP_S / self.lag_s) if self.lag_s > 0.0 else 0.0
        turned = lfilter([(1.0 - keep) / 2.0] * 2, [1.0, -keep], self.gain * delayed)
        return np.asarray(np.interp(times, grid, turned))


@dataclass(frozen=True)
class Loop:
    """The heading loop with some gains, sampled at the controller's ticks."""

    gains: HeadingGains
    transfer: Any  # of the open loop, a `control.TransferFunction`
    gain_margin_db: float
    phase_margin_deg: float
    crossover_radps: float


def commanded_turn_deg(series: Sequence[Series]) -> float:
    """Return the sum of all commanded turns, whatever their direction."""
    return math.degrees(sum(np.abs(rates[:-1]) @ np.diff(times) for times, rates, _ in series))


def yaw_series(path: Path) -> list[Series]:
    """Return the parts of a record with commanded yaw rates."""
    parts: list[list[tuple[float, float, float]]] = [[]]
    for moment in RecordReader(path).moments():
        movement, state = moment.commands.sent.movement, moment.state
        flies = state.flying in {FlyingState.HOVERING, FlyingState.FLYING}
        if isinstance(movement, Velocity | Hover) and flies and not state.pilot_has_control:
            rate_radps = getattr(movement, "yaw_rate_radps", 0.0)
            parts[-1].append((moment.tick.time_s, rate_radps, state.attitude.yaw_rad))
        elif parts[-1]:
            parts.append([])
    found = [np.array(rows).T for rows in parts if len(rows) >= _LEAST_TICKS]
    return [np.stack([times, rates, np.unwrap(yaws)]) for times, rates, yaws in found]


def identify(series: Sequence[Series]) -> tuple[YawResponse, float]:
    """Fit delay, lag and gain to the heading by least squares; return also the residual, rms rad.

    The heading is linear in the gain: only delay and lag are searched.
    """
    if (turn_deg := commanded_turn_deg(series)) < _LEAST_TURN_DEG:
        raise InputError(
            f"expected turns of {_LEAST_TURN_DEG:.0f} degrees or more by yaw-rate commands, got "
            f"{turn_deg:.0f}: record a flight that explores by the map, such as survey_and_land"
        )
    heading = np.concatenate([yaws - yaws.mean() for _, _, yaws in series])

    def fit(delay_s: float, lag_s: float) -> tuple[float, float]:
        unit = YawResponse(delay_s=delay_s, lag_s=lag_s, gain=1.0)
        model = np.concatenate([turned - turned.mean() for turned in map(unit.turned, series)])
        gain = float(model @ heading) / max(float(model @ model), 1e-12)
        return gain, float(np.square(heading - gain * model).sum())

    bounds = (0.0, _LONGEST_S)
    best = brute(lambda x: fit(*np.clip(x, *bounds))[1], (bounds, bounds), Ns=17, finish=fmin)
    delay_s, lag_s = (float(value) for value in np.clip(best, *bounds))
    gain, left = fit(delay_s, lag_s)
    explained = 1.0 - left / max(float(heading @ heading), 1e-12)
    if gain <= 0.0 or explained < _LEAST_FIT:
        raise InputError(
            f"expected a heading that follows the commands, got {max(explained, 0.0):.0%} of it "
            f"explained at gain {gain:.2f}: check that clockwise is positive for both"
        )
    found = YawResponse(delay_s=delay_s, lag_s=lag_s, gain=gain)
    return found, math.sqrt(left / heading.size)


def heading_loop(gains: HeadingGains, response: YawResponse, tick_s: float) -> Loop:
    """Return the loop of a controller with a period of `tick_s`, and its margins."""
    # The PID as computed: backward differences, the integral with the new error.
    p, i, d = gains.proportional, gains.integral * tick_s, gains.derivative / tick_s
    pid = control.TransferFunction([p + i + d, -p - 2.0 * d, d], [1.0, -1.0, 0.0], tick_s)
    # Drone and hold. A held pulse is a step and, one tick later, the opposite step. Times the
    # denominator, its response ends two ticks after the delay: those samples are the numerator.
    lag_s = max(response.lag_s, 1e-6)
    pole = math.exp(-tick_s / lag_s)
    denominator = np.array([1.0, -(1.0 + pole), pole])
    last = math.ceil(response.delay_s / tick_s - 1e-9) + 2
    elapsed = np.maximum(tick_s * np.arange(last + 1) - response.delay_s, 0.0)
    ramp = response.gain * (elapsed + lag_s * np.expm1(-elapsed / lag_s))
    numerator = np.convolve(np.diff(ramp, prepend=0.0), denominator)[: last + 1]
    plant = control.TransferFunction(numerator, np.pad(denominator, (0, last - 2)), tick_s)
    transfer = pid * plant
    # Polynomial roots are inaccurate with poles at 1.
    shares = np.append(np.geomspace(1e-4, 0.1, 200), np.linspace(0.101, 0.999, 800))
    sampled = control.FrequencyResponseData(transfer, math.pi / tick_s * shares, smooth=True)
    gain_margin, phase_margin_deg, _, _, crossover, _ = control.stability_margins(sampled)
    # At half the tick rate the response is real without crossing the real axis.
    end = transfer(-1.0).real
    gain_margin = min(gain_margin, -1.0 / end) if end < 0.0 else gain_margin
    margin_db = 20.0 * math.log10(gain_margin)
    return Loop(gains, transfer, margin_db, float(phase_margin_deg), float(crossover))


def suggested_loop(response: YawResponse, tick_s: float) -> Loop:
    """Return the fastest loop with these margins, with the shipped gains scaled."""
    shipped = HeadingGains()
    for proportional in _PROPORTIONAL:
        share = proportional / shipped.proportional
        i, d = shipped.integral * share, shipped.derivative * share
        gains = replace(shipped, proportional=proportional, integral=i, derivative=d)
        loop = heading_loop(gains, response, tick_s)
        margins = loop.gain_margin_db >= _GAIN_MARGIN_DB, loop.phase_margin_deg >= _PHASE_MARGIN_DEG
        poles = np.roots(np.polyadd(loop.transfer.num[0][0], loop.transfer.den[0][0]))
        if np.abs(poles).max() < 1.0 and all(margins):  # margins of an unstable loop mean nothing
            return loop
    raise InputError(f"expected a response that some gain can steer, got {response}")


def draw(
    series: Sequence[Series], response: YawResponse, loops: Mapping[str, Loop], path: Path
) -> None:
    """Write a PNG: heading and model over the longest series, and small steps."""
    times, _, yaws = longest = max(series, key=np.size)
    figure = Figure(figsize=(7, 5), layout="constrained")
    heading, step = figure.subplots(2, 1)
    for name, line, angles in (("measured", "-", yaws), ("model", "--", response.turned(longest))):
        heading.plot(times, np.degrees(angles - angles.mean()), line, label=name)
    heading.set(xlabel="mission time, s", ylabel="heading, degrees")
    for name, loop in loops.items():
        closed = control.feedback(loop.transfer, 1)
        found = control.step_response(closed, np.arange(0.0, 6.0, loop.transfer.dt))
        step.plot(found.time, found.outputs, label=f"{name}, P {loop.gains.proportional:.1f}/s")
    step.set(xlabel="time since a small step, s", ylabel="share of the step")
    heading.legend()
    step.legend()
    with whole_file(path) as partial:
        figure.savefig(partial, format="png")
