"""The kinds of faults with their effects. Tests may define further `FaultKind` values.

A row has name, description, effect on observations, default level with its unit, and the range of
levels. The effects of a kind without a level get NaN as their level; the kinds `...-nan` report it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, Final, Never, Protocol, TypeVar

import numpy as np

from uav_bt.testing.faults.kind import FaultKind as Kind
from uav_bt.testing.faults.kind import FaultMoment, InjectedError, Observe, Send
from uav_bt.types import (
    Attitude,
    BodyVelocity,
    Command,
    CutMotors,
    DroneState,
    FlyingState,
    Frame,
    Hover,
    Land,
    MoveBy,
    Movement,
    MovementState,
    MovementStatus,
    Observation,
    Release,
    TakeOff,
    Velocity,
    wrap_angle,
)
from uav_bt.types.arrays import Image

_Report = TypeVar("_Report", DroneState, Frame)

# --- images ---------------------------------------------------------------------------------------


def _image(change: Callable[[Frame, FaultMoment], Image]) -> Observe:
    """Return an effect that replaces the image and keeps the rest of the frame."""

    def observe(seen: Observation, at: FaultMoment) -> Observation:
        if seen.frame is None:
            return seen
        return replace(seen, frame=replace(seen.frame, image=change(seen.frame, at)))

    return observe


@_image
def _noisy(frame: Frame, at: FaultMoment) -> Image:
    noise = np.random.default_rng(frame.index).normal(0.0, at.level, frame.image.shape)
    return np.clip(frame.image + noise, 0, 255).astype(np.uint8)


@_image
def _covered(frame: Frame, at: FaultMoment) -> Image:
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


# --- telemetry ------------------------------------------------------------------------------------


class _Change(Protocol):
    """Changes the telemetry of states and of frames alike."""

    def __call__(self, report: _Report, by: float, /) -> _Report: ...


def _both(change: _Change, amount: Callable[[FaultMoment], float] = lambda at: at.level) -> Observe:
    """Return an effect on the state and on the telemetry of frames."""

    def observe(seen: Observation, at: FaultMoment) -> Observation:
        by = amount(at)
        frame = None if seen.frame is None else change(seen.frame, by)
        return replace(seen, frame=frame, state=change(seen.state, by))

    return observe


def _of_state(change: Callable[[DroneState, FaultMoment], DroneState]) -> Observe:
    return lambda seen, at: replace(seen, state=change(seen.state, at))


def _flying(flying: FlyingState) -> Observe:
    return _of_state(lambda state, _: replace(state, flying=flying))


def _heights(report: _Report, height_m: float) -> _Report:
    return replace(report, altitude_m=height_m, height_m=height_m, height_above_ground_m=height_m)


def _raised(report: _Report, by_m: float) -> _Report:
    return replace(
        report,
        altitude_m=report.altitude_m + by_m,
        height_m=report.height_m + by_m,
        height_above_ground_m=report.height_above_ground_m + by_m,
    )


def _turned(report: _Report, by_rad: float) -> _Report:
    yaw_rad = wrap_angle(report.attitude.yaw_rad + by_rad)
    return replace(report, attitude=replace(report.attitude, yaw_rad=yaw_rad))


def _tilted(report: _Report, angle_rad: float) -> _Report:
    attitude = Attitude(roll_rad=angle_rad, pitch_rad=angle_rad, yaw_rad=angle_rad)
    return replace(report, attitude=attitude)


def _pointed(report: _Report, pitch_rad: float) -> _Report:
    return replace(report, gimbal_pitch_rad=pitch_rad)


def _dated(report: _Report, later_s: float) -> _Report:
    changes: dict[str, Any] = {"captured_s": report.captured_s + later_s}
    if isinstance(report, DroneState) and report.measured is not None:
        changes["measured"] = report.measured.shifted(later_s)
    return replace(report, **changes)


@_of_state
def _velocity(state: DroneState, at: FaultMoment) -> DroneState:
    same = BodyVelocity(forward_mps=at.level, right_mps=at.level, down_mps=at.level)
    return replace(state, velocity=same)


def _faster(state: DroneState, by_mps: float) -> DroneState:
    forward_mps = state.velocity.forward_mps + by_mps
    return replace(state, velocity=replace(state.velocity, forward_mps=forward_mps))


@_of_state
def _jumped(state: DroneState, at: FaultMoment) -> DroneState:
    """Shift dead reckoning by the level, in one sample of 0.1 s."""
    return _faster(state, at.level / 0.1) if at.since_s == 0.0 else state


@_of_state
def _drained(state: DroneState, at: FaultMoment) -> DroneState:
    full = 1.0 if at.before.state.battery is None else at.before.state.battery
    return replace(state, battery=max(0.0, full - at.level * at.since_s))


@_of_state
def _never_done(state: DroneState, _at: FaultMoment) -> DroneState:
    moving = state.movement
    if moving is None or moving.state is not MovementState.DONE:
        return state
    return replace(state, movement=replace(moving, state=MovementState.RUNNING))


@_of_state
def _interrupted(state: DroneState, at: FaultMoment) -> DroneState:
    if at.command is None or not isinstance(at.command.movement, MoveBy):
        return state
    status = MovementStatus(id=at.command.movement.id, state=MovementState.INTERRUPTED)
    return replace(state, movement=status)


# --- commands and exceptions ----------------------------------------------------------------------


def _instead(unwanted: type[Movement], movement: Movement) -> Send:
    """Return an effect that replaces commands of one kind by another movement."""

    def send(command: Command, _at: FaultMoment) -> Command:
        refused = isinstance(command.movement, unwanted)
        return replace(command, movement=movement) if refused else command

    return send


def _unheard(_command: Command, _at: FaultMoment) -> Command:
    return Command(movement=Release())


def _unturned(command: Command, _at: FaultMoment) -> Command:
    movement = command.movement
    if isinstance(movement, MoveBy):
        return replace(command, movement=replace(movement, yaw_rad=0.0))
    if isinstance(movement, Velocity):
        return replace(command, movement=replace(movement, yaw_rate_radps=0.0))
    return command


def _cut(command: Command, at: FaultMoment) -> Command:
    """Cut the motors for 0.5 s."""
    return Command(movement=CutMotors()) if at.since_s < 0.5 else command


def _raises(_given: object, _at: FaultMoment) -> Never:
    raise InjectedError("the drone's SDK fell over")


def _listener_raises() -> None:
    raise InjectedError("a display fell over")


# --- the table ------------------------------------------------------------------------------------

_frozen: Final = _image(lambda frame, at: at.still.image if at.still else frame.image)
_black: Final = _image(lambda frame, _: np.zeros_like(frame.image))
_white: Final = _image(lambda frame, _: np.full_like(frame.image, 255))
_half: Final = _image(lambda frame, _: np.ascontiguousarray(frame.image[::2, ::2]))
_empty: Final = _image(lambda frame, _: frame.image[:0, :0])
_late: Final = _delayed(lambda now_s, age_s: now_s - age_s)
_slow: Final = _delayed(lambda now_s, rate_hz: math.floor(now_s * rate_hz) / rate_hz)
_turning: Final = _both(_turned, lambda at: at.level * at.since_s)
_biased: Final = _of_state(lambda state, at: _faster(state, at.level))
_charged: Final = _of_state(lambda state, at: replace(state, battery=at.level))
_piloted: Final = _of_state(lambda state, _: replace(state, pilot_has_control=True))


def _blown(level: float) -> Mapping[str, tuple[float, float]]:
    return {"wind_mps2": (level, 0.0)}


def _slid(level: float) -> Mapping[str, tuple[float, float]]:
    return {"drift_mps": (level, 0.0)}


_KINDS: Final = (
    Kind("frozen", "the image stops, with fresh timestamps and telemetry", _frozen),
    Kind("black", "black images", _black),
    Kind("white", "overexposed images", _white),
    Kind("noise", "white noise, with this standard deviation", _noisy, 80, "grey levels", 0, 255),
    Kind("covered", "a covered lens: blurred and dark", _covered, 0.08, "of the light", 0, 1),
    Kind("late", "late frames, of this age", _late, 1, "s", 0, 6),  # older ones are not kept
    Kind("slow", "slow video", _slow, 4, "frames/s", 0.2, 30),
    Kind("video-lost", "no new frame comes", lambda seen, at: replace(seen, frame=at.before.frame)),
    Kind("no-frame", "observations without a frame", lambda seen, _: replace(seen, frame=None)),
    Kind("half-size", "images of half the size", _half),
    Kind("empty-image", "images without a pixel", _empty),
    Kind(
        "no-telemetry",
        "no new telemetry comes",
        lambda seen, at: replace(seen, state=at.before.state),
    ),
    Kind("link-lost", "nothing comes and nothing arrives", lambda _, at: at.before, send=_unheard),
    Kind("height-nan", "heights NaN", _both(_heights)),
    Kind("height-absurd", "absurd heights", _both(_heights), 1e4, "m"),
    Kind("height-bias", "heights are too great", _both(_raised), 0.3, "m"),
    Kind("attitude-nan", "attitude NaN", _both(_tilted)),
    Kind("attitude-absurd", "absurd angles", _both(_tilted), 100, "rad"),
    Kind("yaw-jump", "a wrong heading", _both(_turned), 0.8, "rad", -3.14, 3.14),
    Kind("yaw-drift", "the heading drifts", _turning, 0.035, "rad/s", -3.14, 3.14),
    Kind("velocity-nan", "velocity NaN", _velocity),
    Kind("velocity-absurd", "an absurd velocity", _velocity, 500, "m/s"),
    Kind("velocity-bias", "the forward velocity is too great, or too low", _biased, -0.2, "m/s"),
    Kind("position-jump", "dead reckoning jumps forward once", _jumped, 1, "m"),
    Kind("time-jump", "later timestamps", _both(_dated), 5, "s"),
    Kind("gimbal-nan", "the camera's pitch NaN", _both(_pointed)),
    Kind("gimbal-absurd", "an absurd camera pitch", _both(_pointed), 50, "rad"),
    Kind(
        "gimbal-stuck",
        "the camera stays where it points",
        send=lambda command, _: replace(command, gimbal=None),
    ),
    Kind("battery-nan", "a charge of NaN", _charged),
    Kind("battery-low", "a low battery", _charged, 0.05, "of the charge", 0, 1),
    Kind("battery-drains", "a draining battery", _drained, 0.1, "of the charge per s", 0, 1),
    Kind("yaw-ignored", "the drone does not turn", send=_unturned),
    Kind("never-done", "no movement is reported done", _never_done),
    Kind(
        "interrupted",
        "every movement is interrupted at once",
        _interrupted,
        send=_instead(MoveBy, Hover()),
    ),
    Kind("no-take-off", "take-off is refused", send=_instead(TakeOff, Release())),
    Kind("no-landing", "landing is refused", send=_instead(Land, Hover())),
    Kind("deaf", "no command arrives", send=_unheard),
    Kind("motors-cut", "the drone stops its motors", send=_cut),
    Kind(
        "emergency-state", "the drone says that its motors were cut", _flying(FlyingState.EMERGENCY)
    ),
    Kind(
        "landed-state", "the drone says that it stands on the ground", _flying(FlyingState.LANDED)
    ),
    Kind("pilot", "a pilot has control", _piloted),
    Kind("wind", "a steady wind towards world x", None, 0.2, "m/s²", -10, 10, disturb=_blown),
    Kind(
        "drift", "drift of the estimate towards world x", None, 0.1, "m/s", -10, 10, disturb=_slid
    ),
    Kind("observe-raises", "observing raises", _raises),
    Kind("send-raises", "sending raises", send=_raises),
    Kind("listener-raises", "a listener raises", follow=_listener_raises),
)

_IN_IMAGE: Final = frozenset({"black", "white", "noise", "covered", "half-size", "empty-image"})
FAULTS: Final[Mapping[str, Kind]] = {
    kind.name: replace(kind, in_image=kind.name in _IN_IMAGE) for kind in _KINDS
}
