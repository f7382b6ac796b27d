"""Fly what the design of the heading loop needs measured, with any drone that speaks the protocol.

These fly the drone themselves, without tree or runner, so they belong to benchmarks and tests. The
drone must have room to hover and turn on the spot.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from behaviours.fly.heading_control import HeadingController, HeadingGains
from benchmarks.heading_design import StepResponse
from uav_bt.errors import DroneError
from uav_bt.protocols import Drone
from uav_bt.types import Command, FlyingState, Hover, TakeOff, Velocity, wrap_angle

_FLOAT = NDArray[np.float64]

_TAKE_OFF_LIMIT_S = 15.0
_CALM_S = 1.0  # after the take-off, and between trials


@dataclass(frozen=True, kw_only=True)
class YawRecording:
    """Yaw-rate commands and the headings they led to; what `identify` wants."""

    times_s: _FLOAT  # (N,)
    commands_radps: _FLOAT  # (N,) sent at those times, held until the next
    yaws_rad: _FLOAT  # (N,) as the drone reports them


def hover(drone: Drone) -> None:
    """Bring a connected drone to a calm hover, from the ground or in the air.

    Raises:
        DroneError: it does not get into the air.
    """
    clock = drone.clock
    give_up_s = clock.now() + _TAKE_OFF_LIMIT_S
    airborne = {FlyingState.HOVERING, FlyingState.FLYING}
    while (flying := drone.observe().state.flying) not in airborne:
        if clock.now() > give_up_s:
            raise DroneError(f"no hover {_TAKE_OFF_LIMIT_S:.0f} s after take-off: {flying.value}")
        drone.send(Command(movement=TakeOff()))
        clock.sleep_until(clock.now() + 0.1)
    drone.send(Command(movement=Hover()))
    clock.sleep_until(clock.now() + _CALM_S)


def record_yaw(
    drone: Drone,
    *,
    amplitude_radps: float = 0.4,
    half_period_s: float = 1.0,
    cycles: int = 6,
    sample_s: float = 0.05,
) -> YawRecording:
    """Swing the heading to and fro with a square wave of yaw rates, and write down what it does.

    Args:
        drone: in a calm hover.
        amplitude_radps: of the rate; small enough to keep clear of the drone's limits.
        half_period_s: how long each rate is held.
        cycles: of two half-periods.
        sample_s: between samples.
    """

    def square(elapsed_s: float, _: float) -> float:
        half = math.floor(elapsed_s / half_period_s + 1e-9)
        return amplitude_radps if half % 2 == 0 else -amplitude_radps

    rows = _run(drone, duration_s=2.0 * cycles * half_period_s, tick_s=sample_s, law=square)
    return YawRecording(times_s=rows[:, 0], commands_radps=rows[:, 2], yaws_rad=rows[:, 1])


def fly_step(
    drone: Drone,
    gains: HeadingGains,
    *,
    step_rad: float,
    duration_s: float = 6.0,
    tick_s: float = 0.1,
) -> StepResponse:
    """Turn a hovering drone by an angle under the heading controller.

    Args:
        drone: in a calm hover.
        gains: of the PID.
        step_rad: how far to turn, clockwise positive, within [-pi, pi].
        duration_s: how long to control.
        tick_s: the controller's period.
    """
    controller = HeadingController(gains)
    start_rad = drone.observe().state.attitude.yaw_rad
    rows = _run(
        drone,
        duration_s=duration_s,
        tick_s=tick_s,
        law=lambda elapsed_s, yaw_rad: controller.update(
            wrap_angle(start_rad + step_rad - yaw_rad), elapsed_s
        ),
    )
    turned = np.unwrap(rows[:, 1]) - start_rad
    # The first sample may lie on the other side of the wrap.
    turned -= 2.0 * math.pi * round(float(turned[0]) / (2.0 * math.pi))
    return StepResponse(times_s=rows[:, 0], yaws_rad=turned, commands_radps=rows[:, 2])


def _run(
    drone: Drone, *, duration_s: float, tick_s: float, law: Callable[[float, float], float]
) -> _FLOAT:
    """Command yaw rates by a law of elapsed time and heading; rows of time, heading, command."""
    clock = drone.clock
    start_s = clock.now()
    rows = []
    for tick in range(round(duration_s / tick_s) + 1):
        clock.sleep_until(start_s + tick * tick_s)
        state = drone.observe().state
        elapsed_s = clock.now() - start_s
        rate_radps = law(elapsed_s, state.attitude.yaw_rad)
        drone.send(Command(movement=Velocity(yaw_rate_radps=rate_radps)))
        rows.append((elapsed_s, state.attitude.yaw_rad, rate_radps))
    drone.send(Command(movement=Hover()))
    clock.sleep_until(clock.now() + _CALM_S)
    return np.array(rows)
