"""The kinds of faults with their effects. Tests may define further `FaultKind` values.

A row has name, description, effect on observations, default level with its unit, and the range of
levels. The effects of a kind without a level get NaN as their level; the kinds `...-nan` report it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Final, Never

import numpy as np

from uav_bt.types import Command, DroneState, FlyingState, Frame, Movement, Observation, wrap_angle
from uav_bt.types.arrays import Image
from uav_bt.types.commands import CutMotors, Hover, Land, MoveBy, Release, TakeOff, Velocity
from uav_bt.types.drone_state import Attitude, BodyVelocity, MovementState, MovementStatus


class InjectedError(RuntimeError):
    """The error that a fault raises: one that no code expects."""


@dataclass(frozen=True, kw_only=True)
class FaultMoment:
    """The inputs of an effect."""

    level: float  # strength, in the kind's unit; NaN for a kind without a level
    since_s: float  # time since the fault's first effect
    before: Observation  # the last observation without the fault, or else the first one
    still: Frame | None  # the last frame without the fault, or else the first one
    past: tuple[Observation, ...]  # without the fault, oldest first, up to the present one
    command: Command | None  # the mission's latest command


Observe = Callable[[Observation, FaultMoment], Observation]
Send = Callable[[Command, FaultMoment], Command]


@dataclass(frozen=True)
class FaultKind:
    """A kind of fault with its effects, all of them optional."""

    name: str
    what: str  # description for people
    observe: Observe | None = None  # changes the observation
    level: float | None = None  # default strength; None: it has no strength
    unit: str = ""  # of the level
    least: float = -math.inf  # levels from here
    most: float = math.inf  # to here can be given
    disturb: str | None = None  # argument of the drone's `disturb`: the level, along world x
    send: Send | None = None  # changes the command
    follow: Callable[[], None] | None = None  # happens in every tick


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

_ANGLES: Final = ("roll_rad", "pitch_rad", "yaw_rad")
_AXES: Final = ("forward_mps", "right_mps", "down_mps")
_HEIGHTS: Final = ("altitude_m", "height_m", "height_above_ground_m")

_Change = Callable[[Any, FaultMoment], Mapping[str, Any]]
"""Returns the changed fields of a state, or of the telemetry of a frame."""


def _state(change: _Change) -> Observe:
    """Return an effect on the state."""
    return lambda seen, at: replace(seen, state=replace(seen.state, **change(seen.state, at)))


def _both(change: _Change) -> Observe:
    """Return an effect on the state and on the telemetry of frames."""

    def observe(seen: Observation, at: FaultMoment) -> Observation:
        frame = seen.frame and replace(seen.frame, **change(seen.frame, at))
        return replace(_state(change)(seen, at), frame=frame)

    return observe


def _yaw(report: DroneState | Frame, by_rad: float) -> Mapping[str, Any]:
    yaw_rad = wrap_angle(report.attitude.yaw_rad + by_rad)
    return {"attitude": replace(report.attitude, yaw_rad=yaw_rad)}


@_both
def _dated(report: DroneState | Frame, at: FaultMoment) -> Mapping[str, Any]:
    later = {"captured_s": report.captured_s + at.level}
    if isinstance(report, Frame) or report.measured is None:
        return later
    return {**later, "measured": report.measured.shifted(at.level)}


def _faster(state: DroneState, by_mps: float) -> Mapping[str, Any]:
    forward_mps = state.velocity.forward_mps + by_mps
    return {"velocity": replace(state.velocity, forward_mps=forward_mps)}


@_state
def _jumped(state: DroneState, at: FaultMoment) -> Mapping[str, Any]:
    """Shift dead reckoning by the level, in one sample of 0.1 s."""
    return _faster(state, at.level / 0.1) if at.since_s == 0.0 else {}


@_state
def _drained(_state: DroneState, at: FaultMoment) -> Mapping[str, Any]:
    full = 1.0 if at.before.state.battery is None else at.before.state.battery
    return {"battery": max(0.0, full - at.level * at.since_s)}


@_state
def _never_done(state: DroneState, _at: FaultMoment) -> Mapping[str, Any]:
    moving = state.movement
    if moving is None or moving.state is not MovementState.DONE:
        return {}
    return {"movement": replace(moving, state=MovementState.RUNNING)}


@_state
def _interrupted(_state: DroneState, at: FaultMoment) -> Mapping[str, Any]:
    move = None if at.command is None else at.command.movement
    if not isinstance(move, MoveBy):
        return {}
    return {"movement": MovementStatus(id=move.id, state=MovementState.INTERRUPTED)}


# --- commands and exceptions ----------------------------------------------------------------------


def _instead(unwanted: type[Movement], movement: Movement) -> Send:
    """Return an effect that replaces commands of one kind by another movement."""

    def send(command: Command, _at: FaultMoment) -> Command:
        refused = isinstance(command.movement, unwanted)
        return replace(command, movement=movement) if refused else command

    return send


def _unheard(_command: Command, _at: FaultMoment) -> Command:
    return Command(movement=Release())


def _unpointed(command: Command, _at: FaultMoment) -> Command:
    return replace(command, gimbal=None)


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
_late: Final = _delayed(lambda now_s, age_s: now_s - age_s)
_slow: Final = _delayed(lambda now_s, rate_hz: math.floor(now_s * rate_hz) / rate_hz)
_tilted: Final = _both(lambda _, at: {"attitude": Attitude(**dict.fromkeys(_ANGLES, at.level))})
_moving: Final = _state(lambda _, at: {"velocity": BodyVelocity(**dict.fromkeys(_AXES, at.level))})
_high: Final = _both(lambda _, at: dict.fromkeys(_HEIGHTS, at.level))
_higher: Final = _both(lambda told, at: {key: getattr(told, key) + at.level for key in _HEIGHTS})
_turned: Final = _both(lambda told, at: _yaw(told, at.level))
_turning: Final = _both(lambda told, at: _yaw(told, at.level * at.since_s))
_pointed: Final = _both(lambda _, at: {"gimbal_pitch_rad": at.level})
_biased: Final = _state(lambda state, at: _faster(state, at.level))
_charged: Final = _state(lambda _, at: {"battery": at.level})
_no_move: Final = _instead(MoveBy, Hover())
_falls: Final = _state(lambda *_: {"flying": FlyingState.EMERGENCY})
_stands: Final = _state(lambda *_: {"flying": FlyingState.LANDED})

_Kind = FaultKind
_KINDS: Final = (
    _Kind("frozen", "the image stops, with fresh timestamps and telemetry", _frozen),
    _Kind("black", "black images", _image(lambda frame, _: np.zeros_like(frame.image))),
    _Kind("white", "overexposed images", _image(lambda frame, _: np.full_like(frame.image, 255))),
    _Kind("noise", "white noise, with this standard deviation", _noisy, 80, "grey levels", 0, 255),
    _Kind("covered", "a covered lens: blurred and dark", _covered, 0.08, "of the light", 0, 1),
    _Kind("late", "late frames, of this age", _late, 1, "s", 0, 6),  # older ones are not kept
    _Kind("slow", "slow video", _slow, 4, "frames/s", 0.2, 30),
    _Kind("video-lost", "no new frame comes", lambda it, at: replace(it, frame=at.before.frame)),
    _Kind("no-frame", "observations without a frame", lambda seen, _: replace(seen, frame=None)),
    _Kind("half-size", "images of half the size", _image(lambda it, _: it.image[::2, ::2].copy())),
    _Kind("empty-image", "images without a pixel", _image(lambda frame, _: frame.image[:0, :0])),
    _Kind("no-telemetry", "no new telemetry comes", _state(lambda _, at: vars(at.before.state))),
    _Kind("link-lost", "nothing comes and nothing arrives", lambda _, at: at.before, send=_unheard),
    _Kind("height-nan", "heights NaN", _high),
    _Kind("height-absurd", "absurd heights", _high, 1e4, "m"),
    _Kind("height-bias", "heights are too great", _higher, 0.3, "m"),
    _Kind("attitude-nan", "attitude NaN", _tilted),
    _Kind("attitude-absurd", "absurd angles", _tilted, 100, "rad"),
    _Kind("yaw-jump", "a wrong heading", _turned, 0.8, "rad", -3.14, 3.14),
    _Kind("yaw-drift", "the heading drifts", _turning, 0.035, "rad/s", -3.14, 3.14),
    _Kind("velocity-nan", "velocity NaN", _moving),
    _Kind("velocity-absurd", "an absurd velocity", _moving, 500, "m/s"),
    _Kind("velocity-bias", "the forward velocity is too great, or too low", _biased, -0.2, "m/s"),
    _Kind("position-jump", "dead reckoning jumps forward once", _jumped, 1, "m"),
    _Kind("time-jump", "later timestamps", _dated, 5, "s"),
    _Kind("gimbal-nan", "the camera's pitch NaN", _pointed),
    _Kind("gimbal-absurd", "an absurd camera pitch", _pointed, 50, "rad"),
    _Kind(
        "gimbal-stuck",
        "the camera stays where it points",
        send=_unpointed,
    ),
    _Kind("battery-nan", "a charge of NaN", _charged),
    _Kind("battery-low", "a low battery", _charged, 0.05, "of the charge", 0, 1),
    _Kind("battery-drains", "a draining battery", _drained, 0.1, "of the charge per s", 0, 1),
    _Kind("yaw-ignored", "the drone does not turn", send=_unturned),
    _Kind("never-done", "no movement is reported done", _never_done),
    _Kind("interrupted", "every movement is interrupted at once", _interrupted, send=_no_move),
    _Kind("no-take-off", "take-off is refused", send=_instead(TakeOff, Release())),
    _Kind("no-landing", "landing is refused", send=_instead(Land, Hover())),
    _Kind("deaf", "no command arrives", send=_unheard),
    _Kind("motors-cut", "the drone stops its motors", send=_cut),
    _Kind("emergency-state", "the drone says that its motors were cut", _falls),
    _Kind("landed-state", "the drone says that it stands on the ground", _stands),
    _Kind("pilot", "a pilot has control", _state(lambda *_: {"pilot_has_control": True})),
    _Kind("wind", "a steady wind towards world x", None, 0.2, "m/s²", -10, 10, "wind_mps2"),
    _Kind("drift", "drift of the estimate towards world x", None, 0.1, "m/s", -10, 10, "drift_mps"),
    _Kind("observe-raises", "observing raises", _raises),
    _Kind("send-raises", "sending raises", send=_raises),
    _Kind("listener-raises", "a listener raises", follow=_listener_raises),
)
FAULTS: Final[Mapping[str, FaultKind]] = {kind.name: kind for kind in _KINDS}
