"""The effects of faults on images, telemetry and commands, under the names that the table uses."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any, Final, Never, Protocol, TypeVar

import numpy as np

from uav_bt.testing.faults.kind import FaultMoment, InjectedError, Observe, Send
from uav_bt.types import (
    Attitude,
    BodyVelocity,
    Command,
    CutMotors,
    DroneState,
    FlyingState,
    Frame,
    MoveBy,
    Movement,
    MovementState,
    MovementStatus,
    Observation,
    Release,
    Velocity,
    wrap_angle,
)
from uav_bt.types.arrays import Image

Report = TypeVar("Report", DroneState, Frame)

# --- images ---------------------------------------------------------------------------------------


def image(change: Callable[[Frame, FaultMoment], Image]) -> Observe:
    """Return an effect that replaces the image and keeps the rest of the frame."""

    def observe(seen: Observation, at: FaultMoment) -> Observation:
        if seen.frame is None:
            return seen
        return replace(seen, frame=replace(seen.frame, image=change(seen.frame, at)))

    return observe


black: Final = image(lambda frame, _: np.zeros_like(frame.image))
white: Final = image(lambda frame, _: np.full_like(frame.image, 255))
half_size: Final = image(lambda frame, _: np.ascontiguousarray(frame.image[::2, ::2]))
empty: Final = image(lambda frame, _: frame.image[:0, :0])


@image
def frozen(frame: Frame, at: FaultMoment) -> Image:
    """Return the last image from before the fault, or else the first one."""
    return frame.image if at.still is None else at.still.image


@image
def noisy(frame: Frame, at: FaultMoment) -> Image:
    """Return the image with white noise, the same for the same frame."""
    noise = np.random.default_rng(frame.index).normal(0.0, at.level, frame.image.shape)
    return np.clip(frame.image + noise, 0, 255).astype(np.uint8)


@image
def covered(frame: Frame, at: FaultMoment) -> Image:
    """Return the image dark and blurred."""
    import cv2  # noqa: PLC0415 - few faults need it

    height_px, width_px = frame.image.shape[:2]
    # Blurred over a tenth of its width, an image has no details for more pixels than these.
    small = cv2.resize(frame.image, (64, 36), interpolation=cv2.INTER_AREA)
    blurred = cv2.GaussianBlur(small, (0, 0), 6.4)
    large = cv2.resize(blurred, (width_px, height_px), interpolation=cv2.INTER_LINEAR)
    return (at.level * large).astype(np.uint8)


def _delayed(until: Callable[[float, float], float]) -> Observe:
    """Return an effect that shows the newest frame until a time, or else the oldest kept one."""

    def observe(seen: Observation, at: FaultMoment) -> Observation:
        if seen.frame is None:
            return seen
        until_s = until(seen.frame.captured_s, at.level) + 1e-6
        frames = [past.frame for past in at.past if past.frame is not None]
        old = [frame for frame in frames if frame.captured_s <= until_s]
        return replace(seen, frame=old[-1] if old else frames[0])

    return observe


late: Final = _delayed(lambda now_s, age_s: now_s - age_s)
slow: Final = _delayed(lambda now_s, rate_hz: math.floor(now_s * rate_hz) / rate_hz)


# --- telemetry ------------------------------------------------------------------------------------


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
        return replace(seen, frame=frame, state=change(seen.state, by))

    return observe


def of_state(change: Callable[[DroneState, FaultMoment], DroneState]) -> Observe:
    """Return an effect on the state alone."""
    return lambda seen, at: replace(seen, state=change(seen.state, at))


def flying(flying: FlyingState) -> Observe:
    """Return an effect that reports a flying state."""
    return of_state(lambda state, _: replace(state, flying=flying))


@both
def heights(report: Report, height_m: float) -> Report:
    """Return a height in place of all heights."""
    return replace(report, altitude_m=height_m, height_m=height_m, height_above_ground_m=height_m)


@both
def raised(report: Report, by_m: float) -> Report:
    """Return telemetry with greater heights."""
    return replace(
        report,
        altitude_m=report.altitude_m + by_m,
        height_m=report.height_m + by_m,
        height_above_ground_m=report.height_above_ground_m + by_m,
    )


def _turned(report: Report, by_rad: float) -> Report:
    """Return telemetry with a changed heading."""
    yaw_rad = wrap_angle(report.attitude.yaw_rad + by_rad)
    return replace(report, attitude=replace(report.attitude, yaw_rad=yaw_rad))


turned: Final = both(_turned)
turning: Final = both(_turned, lambda at: at.level * at.since_s)


@both
def tilted(report: Report, angle_rad: float) -> Report:
    """Return telemetry with one angle for roll, pitch and yaw."""
    attitude = Attitude(roll_rad=angle_rad, pitch_rad=angle_rad, yaw_rad=angle_rad)
    return replace(report, attitude=attitude)


@both
def pointed(report: Report, pitch_rad: float) -> Report:
    """Return telemetry with another pitch of the camera."""
    return replace(report, gimbal_pitch_rad=pitch_rad)


@both
def dated(report: Report, later_s: float) -> Report:
    """Return telemetry with a later timestamp."""
    changes: dict[str, Any] = {"captured_s": report.captured_s + later_s}
    if isinstance(report, DroneState) and report.measured is not None:
        changes["measured"] = report.measured.shifted(later_s)
    return replace(report, **changes)


@of_state
def velocity(state: DroneState, at: FaultMoment) -> DroneState:
    """Return a velocity in place of all velocities."""
    same = BodyVelocity(forward_mps=at.level, right_mps=at.level, down_mps=at.level)
    return replace(state, velocity=same)


def _faster(state: DroneState, by_mps: float) -> DroneState:
    """Return the state with more forward velocity."""
    forward_mps = state.velocity.forward_mps + by_mps
    return replace(state, velocity=replace(state.velocity, forward_mps=forward_mps))


biased: Final = of_state(lambda state, at: _faster(state, at.level))
charged: Final = of_state(lambda state, at: replace(state, battery=at.level))
piloted: Final = of_state(lambda state, _: replace(state, pilot_has_control=True))


@of_state
def jumped(state: DroneState, at: FaultMoment) -> DroneState:
    """Return one sample with a velocity that shifts dead reckoning by the level in 0.1 s."""
    return _faster(state, at.level / 0.1) if at.since_s == 0.0 else state


@of_state
def drained(state: DroneState, at: FaultMoment) -> DroneState:
    """Return the state with a battery that drains."""
    full = 1.0 if at.before.state.battery is None else at.before.state.battery
    return replace(state, battery=max(0.0, full - at.level * at.since_s))


@of_state
def never_done(state: DroneState, _at: FaultMoment) -> DroneState:
    """Report every movement that is done as running."""
    moving = state.movement
    if moving is None or moving.state is not MovementState.DONE:
        return state
    return replace(state, movement=replace(moving, state=MovementState.RUNNING))


@of_state
def interrupted(state: DroneState, at: FaultMoment) -> DroneState:
    """Report the latest movement as interrupted."""
    if at.command is None or not isinstance(at.command.movement, MoveBy):
        return state
    status = MovementStatus(id=at.command.movement.id, state=MovementState.INTERRUPTED)
    return replace(state, movement=status)


# --- commands and exceptions ----------------------------------------------------------------------


def instead(unwanted: type[Movement], movement: Movement) -> Send:
    """Return an effect that replaces commands of one kind by another movement."""

    def send(command: Command, _at: FaultMoment) -> Command:
        refused = isinstance(command.movement, unwanted)
        return replace(command, movement=movement) if refused else command

    return send


def unheard(_command: Command, _at: FaultMoment) -> Command:
    """Return the command of a drone that receives none."""
    return Command(movement=Release())


def unturned(command: Command, _at: FaultMoment) -> Command:
    """Return the command without its turn."""
    movement = command.movement
    if isinstance(movement, MoveBy):
        return replace(command, movement=replace(movement, yaw_rad=0.0))
    if isinstance(movement, Velocity):
        return replace(command, movement=replace(movement, yaw_rate_radps=0.0))
    return command


def cut(command: Command, at: FaultMoment) -> Command:
    """Return a cut of the motors for 0.5 s, then the command."""
    return Command(movement=CutMotors()) if at.since_s < 0.5 else command


def raises(_given: object, _at: FaultMoment) -> Never:
    """Raise."""
    raise InjectedError("the drone's SDK fell over")


def listener_raises() -> None:
    """Raise."""
    raise InjectedError("a display fell over")
