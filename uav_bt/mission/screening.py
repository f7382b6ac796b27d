"""Drops impossible measurements: the mission sees the last plausible ones, with their times.

The rules about old telemetry and old frames (`uav_bt.mission.safety`) therefore treat an impossible
measurement as a missing one. Nothing is steered by battery and link: their shares become unknown.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Final

from uav_bt.types import CameraModel, DroneState, Frame, Observation

FrameJudge = Callable[[Frame, DroneState], str | None]
"""Returns why a frame cannot be flown by, None if it can."""

_Bound = tuple[str, float, float]

# Believed beside impossible values: a landing must be recognised.
_BELIEVED: Final = ("flying", "movement", "pilot_has_control", "connected", "lost", "faults")

# Bounds of a small camera drone's reports. All are chosen, far beyond an ANAFI's flight.
_TILT_RAD: Final = math.pi / 2  # roll and pitch
_HEIGHT_M: Final = 150.0  # altitude and height, above or below
_SPEED_MPS: Final = 20.0  # on each axis
_CLIMB_MPS: Final = 4.0  # change of the altitude between two measurements
_NOISE_M: Final = 1.6  # of the altitude at once: barometers forget a gust or an opened door slowly
_AHEAD_S: Final = 0.5  # of a time over the mission clock: two clocks differ


class Screening:
    """Replaces impossible telemetry and frames by the last plausible ones.

    Frames must have the size of the camera; the judge checks the image of each new one.
    """

    def __init__(self, camera: CameraModel, judge: FrameJudge | None = None) -> None:
        self._size_px = (camera.width_px, camera.height_px)
        self._judge = judge
        self._state: DroneState | None = None
        self._frame: Frame | None = None
        self._newest: tuple[int, float] | None = None  # index and time of the last frame judged
        self.state_fault: str | None = None  # why the newest telemetry was refused
        self.frame_fault: str | None = None  # why the newest frame was refused
        self.warnings: tuple[str, ...] = ()  # shares that cannot be, while they are reported

    @property
    def refused(self) -> tuple[str, ...]:
        """The refused parts of the newest observation, each with the reason."""
        faults = (("frame", self.frame_fault), ("telemetry", self.state_fault))
        return tuple(f"{what}: {fault}" for what, fault in faults if fault is not None)

    def usable(self, observation: Observation, now_s: float) -> Observation:
        """Return the observation, impossible values replaced by the last plausible ones."""
        state = self._usable_state(observation.state, now_s)
        self._take_frame(observation.frame, state, now_s)
        return Observation(frame=self._frame, state=state)

    def _usable_state(self, state: DroneState, now_s: float) -> DroneState:
        self.state_fault = next(_state_faults(state, self._state, now_s), None)
        shares = (("battery", state.battery), ("link", state.link))
        self.warnings = tuple(
            f"the {name} is reported as {share:g}: taken for unknown"
            for name, share in shares
            if share is not None and not share <= 1.0
        )
        if self.state_fault is None:
            self._state = replace(state, battery=_known(state.battery), link=_known(state.link))
            return self._state
        good = self._state or DroneState(captured_s=-math.inf, flying=state.flying)
        return replace(good, **{name: getattr(state, name) for name in _BELIEVED})

    def _take_frame(self, frame: Frame | None, state: DroneState, now_s: float) -> None:
        if frame is None or (frame.index, frame.captured_s) == self._newest:
            return
        if self._frame is not None and frame.captured_s < self._frame.captured_s:
            return  # a link may deliver frames in another order
        self._newest = frame.index, frame.captured_s
        self.frame_fault = next(self._frame_faults(frame, state, now_s), None)
        if self.frame_fault is None:
            self._frame = frame

    def _frame_faults(self, frame: Frame, state: DroneState, now_s: float) -> Iterator[str]:
        yield from _early(frame.captured_s, now_s)
        yield from _impossible(_bounds(frame))
        height_px, width_px = frame.image.shape[:2]
        if (width_px, height_px) != self._size_px:
            expected = "{}x{}".format(*self._size_px)
            yield f"its image is {width_px}x{height_px}, expected {expected} as the camera's"
        elif self._judge is not None and (fault := self._judge(frame, state)) is not None:
            yield fault


def _state_faults(state: DroneState, good: DroneState | None, now_s: float) -> Iterator[str]:
    for time_s in vars(state.times).values():
        yield from _early(time_s, now_s)
    velocity = state.velocity
    yield from _impossible(
        [
            *_bounds(state),
            ("speed", velocity.forward_mps, _SPEED_MPS),
            ("speed", velocity.right_mps, _SPEED_MPS),
            ("vertical speed", velocity.down_mps, _SPEED_MPS),
        ]
    )
    if good is not None:
        passed_s = max(0.0, state.times.altitude_s - good.times.altitude_s)
        climbed_m = state.altitude_m - good.altitude_m
        if abs(climbed_m) > _NOISE_M + _CLIMB_MPS * passed_s:
            yield f"its altitude changed by {climbed_m:.1f} m in {passed_s:.1f} s"


def _early(captured_s: float, now_s: float) -> Iterator[str]:
    if math.isnan(captured_s) or captured_s - now_s > _AHEAD_S:
        yield f"its time is {captured_s - now_s:.1f} s in the future"


def _bounds(report: DroneState | Frame) -> list[_Bound]:
    """Return name, value and greatest size of what telemetry and frames both have."""
    return [
        ("roll", report.attitude.roll_rad, _TILT_RAD),
        ("pitch", report.attitude.pitch_rad, _TILT_RAD),
        ("yaw", report.attitude.yaw_rad, math.inf),
        ("gimbal pitch", report.gimbal_pitch_rad, math.pi),
        ("altitude", report.altitude_m, _HEIGHT_M),
        ("height", report.height_m, _HEIGHT_M),
        ("height above the ground", report.height_above_ground_m, _HEIGHT_M),
    ]


def _impossible(bounds: list[_Bound]) -> Iterator[str]:
    for name, value, most in bounds:
        if not (math.isfinite(value) and abs(value) <= most):
            yield f"its {name} is {value:g}"


def _known(share: float | None) -> float | None:
    """Return a share from 0 to 1, else None; by a negative one autopilots say unknown."""
    return share if share is not None and 0.0 <= share <= 1.0 else None
