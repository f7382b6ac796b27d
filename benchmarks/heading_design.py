"""Design of the heading loop: identify the drone's yaw response, and check the gains on it.

The drone answers a yaw-rate command like a first-order lag behind a dead time, and the rate
integrates to the heading:

    yaw(s) / command(s) = gain * exp(-dead_time * s) / (s * (lag * s + 1))

The controller speaks once a tick and its command holds until the next one. Sampled at the ticks,
plant and hold together have an exact discrete transfer function, whatever the dead time (Astrom and
Wittenmark, *Computer-Controlled Systems*, section 2.6), so the margins need no Pade approximation.

Clockwise is positive for commands and headings alike. Only `margins` needs the `design` extra.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from behaviours.fly.heading_control import HeadingController, HeadingGains
from uav_bt.errors import ShapeError, ValueRangeError
from uav_bt.plugins import need

_FLOAT = NDArray[np.float64]

# The search for dead time and lag: a grid over all that a drone may show, then ever finer ones.
_LONGEST_S = 0.8
_GRID = 17
_REFINEMENTS = 7
_SETTLED_SHARE = 0.05  # of the step: the band that counts as settled


@dataclass(frozen=True, kw_only=True)
class YawResponse:
    """Dead time, first-order lag and gain from yaw-rate command to yaw rate."""

    dead_time_s: float  # from sending a command to its first effect
    lag_s: float  # time constant of the rate
    gain: float = 1.0  # rate reached per rate commanded

    def __post_init__(self) -> None:
        if not (self.dead_time_s >= 0.0 and self.lag_s >= 0.0 and self.gain > 0.0):
            raise ValueRangeError(
                f"dead time and lag must be zero or positive and the gain positive, got {self}"
            )

    def ramp(self, elapsed_s: ArrayLike) -> _FLOAT:
        """Return the heading reached after a unit step of the command, rad; any shape."""
        elapsed = np.maximum(np.asarray(elapsed_s, dtype=np.float64) - self.dead_time_s, 0.0)
        if self.lag_s == 0.0:
            return self.gain * elapsed
        return np.asarray(self.gain * (elapsed + self.lag_s * np.expm1(-elapsed / self.lag_s)))

    def turned(self, times_s: _FLOAT, commands_radps: _FLOAT) -> _FLOAT:
        """Return how far commands, each held until the next, have turned a drone that was at rest.

        Args:
            times_s: (N,) increasing.
            commands_radps: (N,) sent at those times.

        Returns:
            (N,) rad, at those times.
        """
        changes = np.diff(commands_radps, prepend=0.0)
        moments = np.flatnonzero(changes)
        return self.ramp(times_s[:, None] - times_s[moments]) @ changes[moments]


@dataclass(frozen=True, kw_only=True)
class Margins:
    """How far the loop is from instability."""

    gain_margin_db: float  # the gain may grow by so much
    phase_margin_rad: float  # the phase may lag by so much more
    crossover_radps: float  # where the loop's gain is one: about the closed loop's bandwidth


@dataclass(frozen=True, kw_only=True)
class StepResponse:
    """A closed-loop step, modelled or flown."""

    times_s: _FLOAT  # (N,) from the step
    yaws_rad: _FLOAT  # (N,) turned since the step
    commands_radps: _FLOAT  # (N,) sent at those times


@dataclass(frozen=True, kw_only=True)
class StepMetrics:
    """The usual figures of a step response; NaN for what was not reached."""

    rise_time_s: float  # from 10 % to 90 %
    overshoot: float  # share of the step
    settling_time_s: float  # until it stays within 5 % of the step


def identify(times_s: ArrayLike, commands_radps: ArrayLike, yaws_rad: ArrayLike) -> YawResponse:
    """Fit dead time, lag and gain to a recording, by least squares on the heading.

    For given dead time and lag the heading is linear in gain and starting heading, so only those
    two are searched.

    Args:
        times_s: (N,) increasing times of the samples.
        commands_radps: (N,) yaw rates commanded at those times, each held until the next; the drone
            must have been at rest before the first.
        yaws_rad: (N,) headings at those times, wrapped or not.

    Raises:
        ShapeError: the arrays are not one-dimensional and of one length.
        ValueRangeError: too few samples, a command that never changes, or a drone that does not
            follow.
    """
    times, commands = (np.asarray(a, dtype=np.float64) for a in (times_s, commands_radps))
    yaws = np.unwrap(np.asarray(yaws_rad, dtype=np.float64))
    for name, array in (("commands", commands), ("yaws", yaws)):
        if times.ndim != 1 or array.shape != times.shape:
            raise ShapeError(name, expected=f"N, as the {times.size} times", actual=array.shape)
    if times.size < 10 or not commands.any():
        raise ValueRangeError("identification needs 10 samples or more and a command that is not 0")

    def fit(dead_time_s: float, lag_s: float) -> tuple[float, float]:
        unit = YawResponse(dead_time_s=dead_time_s, lag_s=lag_s).turned(times, commands)
        basis, target = unit - unit.mean(), yaws - yaws.mean()
        power = float(basis @ basis)
        gain = float(basis @ target) / power if power > 0.0 else 0.0
        residual = target - gain * basis
        return float(residual @ residual), gain

    dead_times = lags = np.linspace(0.0, _LONGEST_S, _GRID)
    width_s = _LONGEST_S / (_GRID - 1)
    best = (math.inf, 0.0, 0.0, 0.0)
    for _ in range(_REFINEMENTS):
        best = min(best, *((*fit(dead, lag), dead, lag) for dead in dead_times for lag in lags))
        _, _, dead_time_s, lag_s = best
        dead_times, lags = (
            np.maximum(0.0, centre + np.linspace(-width_s, width_s, 7))
            for centre in (dead_time_s, lag_s)
        )
        width_s /= 3.0
    error, gain, dead_time_s, lag_s = best
    if not gain > 0.0 or not math.isfinite(error):
        raise ValueRangeError(
            f"the heading does not follow the commands (gain {gain:.2f}): was the drone in the "
            "air, and is clockwise positive for both?"
        )
    return YawResponse(dead_time_s=float(dead_time_s), lag_s=float(lag_s), gain=gain)


def margins(gains: HeadingGains, response: YawResponse, tick_s: float = 0.1) -> Margins:
    """Return the loop's margins at the controller's tick, sample and hold included.

    Args:
        gains: of the PID.
        response: of the drone.
        tick_s: the controller's period.

    Raises:
        MissingDependencyError: the package `control` is not installed.
    """
    need("design", "control", what="the heading loop's margin")
    import control  # noqa: PLC0415  (only for design, in an extra)

    loop = _controller(control, gains, tick_s) * _plant(control, response, tick_s)
    # Polynomial roots are inaccurate with poles at 1; a fine frequency response is not.
    half_rate = math.pi / tick_s
    omega = half_rate * np.append(np.geomspace(1e-4, 0.1, 200), np.linspace(0.101, 0.999, 800))
    sampled = control.FrequencyResponseData(loop, omega, smooth=True)
    gain_margin, phase_margin_deg, _, _, crossover, _ = control.stability_margins(sampled)
    # At half the tick rate the response ends on the real axis, which is no crossing of it.
    end = loop(-1.0).real
    gain_margin = min(gain_margin, -1.0 / end) if end < 0.0 else gain_margin
    return Margins(
        gain_margin_db=20.0 * math.log10(gain_margin),
        phase_margin_rad=math.radians(phase_margin_deg),
        crossover_radps=float(crossover),
    )


def _controller(control: Any, gains: HeadingGains, tick_s: float) -> Any:
    """Return the PID as it is computed: backward differences, the integral with the new error."""
    p, i, d = gains.proportional, gains.integral * tick_s, gains.derivative / tick_s
    return control.TransferFunction([p + i + d, -p - 2.0 * d, d], [1.0, -1.0, 0.0], tick_s)


def _plant(control: Any, response: YawResponse, tick_s: float) -> Any:
    """Return the exact discrete transfer function of hold, dead time, lag and integrator."""
    pole = math.exp(-tick_s / response.lag_s) if response.lag_s > 0.0 else 0.0
    denominator = np.array([1.0, -(1.0 + pole), pole])
    # A held pulse is a step and, a tick later, the opposite step. Times the denominator, its
    # response ends two ticks after the dead time: those samples are the numerator.
    last = math.ceil(response.dead_time_s / tick_s - 1e-9) + 2
    pulse = np.diff(response.ramp(tick_s * np.arange(last + 1)), prepend=0.0)
    numerator = np.convolve(pulse, denominator)[: last + 1]
    padded = np.pad(denominator, (0, last - 2))
    return control.TransferFunction(numerator, padded, tick_s)


def step_response(
    gains: HeadingGains,
    response: YawResponse,
    *,
    step_rad: float,
    duration_s: float = 6.0,
    tick_s: float = 0.1,
) -> StepResponse:
    """Return what the controller makes of a step of the wanted heading, its limits included.

    Args:
        gains: of the PID.
        response: of the drone.
        step_rad: how far to turn, clockwise positive, within [-pi, pi].
        duration_s: how long to look.
        tick_s: the controller's period.
    """
    controller = HeadingController(gains)
    count = round(duration_s / tick_s) + 1
    times: _FLOAT = tick_s * np.arange(count, dtype=np.float64)
    yaws, commands = np.zeros(count), np.zeros(count)
    for tick in range(count):
        # The command of this very tick has no effect yet, so its being unknown does no harm.
        yaws[tick] = response.turned(times[: tick + 1], commands[: tick + 1])[-1]
        commands[tick] = controller.update(step_rad - yaws[tick], float(times[tick]))
    return StepResponse(times_s=times, yaws_rad=yaws, commands_radps=commands)


def step_metrics(response: StepResponse, step_rad: float) -> StepMetrics:
    """Return rise time, overshoot and settling time of a step.

    Args:
        response: modelled or flown.
        step_rad: the step that was asked for; not zero.
    """
    share = response.yaws_rad / step_rad
    times = response.times_s

    def first(level: float) -> float:
        reached = share >= level
        if not reached.any():
            return math.nan
        after = int(reached.argmax())
        if after == 0:
            return float(times[0])
        return float(np.interp(level, share[after - 1 : after + 1], times[after - 1 : after + 1]))

    outside = np.flatnonzero(np.abs(share - 1.0) > _SETTLED_SHARE)
    settled = 0 if outside.size == 0 else int(outside[-1]) + 1
    return StepMetrics(
        rise_time_s=first(0.9) - first(0.1),
        overshoot=max(0.0, float(share.max()) - 1.0),
        settling_time_s=float(times[settled]) if settled < times.size else math.nan,
    )
