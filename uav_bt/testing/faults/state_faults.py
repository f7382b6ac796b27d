"""Faults of telemetry: in the state, and in the telemetry of frames."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, Protocol, TypeVar

from uav_bt.testing.faults.kind import FaultMoment, Observe
from uav_bt.types import (
    Attitude,
    BodyVelocity,
    DroneState,
    FlyingState,
    Frame,
    Observation,
    wrap_angle,
)

Report = TypeVar("Report", DroneState, Frame)


def height(report: Report, height_m: float) -> Report:
    """Return a height in place of all heights."""
    return replace(report, altitude_m=height_m, height_m=height_m, height_above_ground_m=height_m)


def raised(report: Report, by_m: float) -> Report:
    """Return telemetry with greater heights."""
    return replace(
        report,
        altitude_m=report.altitude_m + by_m,
        height_m=report.height_m + by_m,
        height_above_ground_m=report.height_above_ground_m + by_m,
    )


def turned(report: Report, by_rad: float) -> Report:
    """Return telemetry with a changed heading."""
    yaw_rad = wrap_angle(report.attitude.yaw_rad + by_rad)
    return replace(report, attitude=replace(report.attitude, yaw_rad=yaw_rad))


def tilted(report: Report, angle_rad: float) -> Report:
    """Return telemetry with one angle for roll, pitch and yaw."""
    attitude = Attitude(roll_rad=angle_rad, pitch_rad=angle_rad, yaw_rad=angle_rad)
    return replace(report, attitude=attitude)


def pointed(report: Report, pitch_rad: float) -> Report:
    """Return telemetry with another pitch of the camera."""
    return replace(report, gimbal_pitch_rad=pitch_rad)


def dated(report: Report, later_s: float) -> Report:
    """Return telemetry with a later timestamp."""
    changes: dict[str, Any] = {"captured_s": report.captured_s + later_s}
    if isinstance(report, DroneState) and report.measured is not None:
        changes["measured"] = report.measured.shifted(later_s)
    return replace(report, **changes)


class Change(Protocol):
    """Changes the telemetry of states and of frames alike."""

    def __call__(self, report: Report, by: float, /) -> Report:
        """Return the changed telemetry."""
        ...


def both(change: Change, amount: Callable[[FaultMoment], float] = lambda at: at.level) -> Observe:
    """Return an effect on the state and on the telemetry of frames."""

    def observe(seen: Observation, at: FaultMoment) -> Observation:
        by = amount(at)
        frame = None if seen.frame is None else change(seen.frame, by)
        return Observation(frame=frame, state=change(seen.state, by))

    return observe


def of_state(change: Callable[[DroneState, FaultMoment], DroneState]) -> Observe:
    """Return an effect on the state alone."""
    return lambda seen, at: replace(seen, state=change(seen.state, at))


def velocity(state: DroneState, at: FaultMoment) -> DroneState:
    """Return a velocity in place of all velocities."""
    speed = at.level
    same = BodyVelocity(forward_mps=speed, right_mps=speed, down_mps=speed)
    return replace(state, velocity=same)


def faster(state: DroneState, by_mps: float) -> DroneState:
    """Return the state with more forward velocity."""
    forward_mps = state.velocity.forward_mps + by_mps
    return replace(state, velocity=replace(state.velocity, forward_mps=forward_mps))


def jumped(state: DroneState, at: FaultMoment) -> DroneState:
    """Return one sample with a velocity that shifts dead reckoning by the level in 0.1 s."""
    return faster(state, at.level / 0.1) if at.since_s == 0.0 else state


def drained(state: DroneState, at: FaultMoment) -> DroneState:
    """Return the state with a battery that drains."""
    full = 1.0 if at.before.state.battery is None else at.before.state.battery
    return replace(state, battery=max(0.0, full - at.level * at.since_s))


def flying(flying: FlyingState) -> Observe:
    """Return an effect that reports a flying state."""
    return of_state(lambda state, _: replace(state, flying=flying))
