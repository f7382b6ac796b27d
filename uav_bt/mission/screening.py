"""Drops impossible measurements: the mission sees the last plausible ones, with their times.

The rules about old telemetry and old frames (`uav_bt.mission.safety`) therefore treat an impossible
measurement as a missing one.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from uav_bt.types import CameraModel, DroneState, Frame, Observation

FrameJudge = Callable[[Frame, DroneState], str | None]
"""Returns why a frame cannot be flown by, None if it can."""


@dataclass(frozen=True, kw_only=True)
class ScreeningConfig:
    """Bounds of a small camera drone's reports. All are chosen, far beyond an ANAFI's flight.

    Attributes:
        tilt_rad: largest roll and pitch, rad: a right angle.
        height_m: largest altitude and height, above or below, m.
        speed_mps: largest speed on each axis, m/s.
        vertical_speed_mps: fastest change of the altitude between two measurements, m/s.
        altitude_noise_m: change of the altitude that is allowed at once, m. Barometers forget a
            gust or an opened door slowly.
        ahead_s: largest lead of a time over the mission clock, s, because two clocks differ.
    """

    tilt_rad: float = math.pi / 2
    height_m: float = 150.0
    speed_mps: float = 20.0
    vertical_speed_mps: float = 4.0
    altitude_noise_m: float = 1.6
    ahead_s: float = 0.5


class Screening:
    """Replaces impossible telemetry and frames by the last plausible ones.

    Args:
        camera: intrinsics at the size that frames must have.
        judge: checks the image of each new frame; None accepts every image.
        config: bounds of plausible values.
    """

    def __init__(
        self,
        camera: CameraModel,
        judge: FrameJudge | None = None,
        config: ScreeningConfig | None = None,
    ) -> None:
        self._size_px = (camera.width_px, camera.height_px)
        self._judge = judge
        self._config = config or ScreeningConfig()
        self._state: DroneState | None = None
        self._frame: Frame | None = None
        self._newest: tuple[int, float] | None = None  # index and time of the last frame judged
        self.state_fault: str | None = None  # why the newest telemetry was refused
        self.frame_fault: str | None = None  # why the newest frame was refused

    @property
    def refused(self) -> tuple[str, ...]:
        """The refused parts of the newest observation, each with the reason."""
        faults = (("frame", self.frame_fault), ("telemetry", self.state_fault))
        return tuple(f"{what}: {fault}" for what, fault in faults if fault is not None)

    def usable(self, observation: Observation, now_s: float) -> Observation:
        """Return the observation, impossible values replaced by the last plausible ones.

        Args:
            observation: the drone's.
            now_s: mission clock, s.
        """
        state = self._usable_state(observation.state, now_s)
        self._take_frame(observation.frame, state, now_s)
        return Observation(frame=self._frame, state=state)

    def _usable_state(self, state: DroneState, now_s: float) -> DroneState:
        self.state_fault = _first(
            *(self._late_or_early(time_s, now_s) for time_s in vars(state.times).values()),
            self._impossible(state),
            self._jump(state),
        )
        if self.state_fault is None:
            self._state = replace(state, battery=_known(state.battery), link=_known(state.link))
            return self._state
        good = self._state or DroneState(captured_s=-math.inf, flying=state.flying)
        # Flying state, movement and faults are believed: a landing must be recognised.
        return replace(
            good,
            flying=state.flying,
            movement=state.movement,
            pilot_has_control=state.pilot_has_control,
            connected=state.connected,
            lost=state.lost,
            faults=state.faults,
        )

    def _take_frame(self, frame: Frame | None, state: DroneState, now_s: float) -> None:
        if frame is None or (frame.index, frame.captured_s) == self._newest:
            return
        if self._frame is not None and frame.captured_s < self._frame.captured_s:
            return  # a link may deliver frames in another order
        self._newest = frame.index, frame.captured_s
        self.frame_fault = _first(
            self._late_or_early(frame.captured_s, now_s),
            self._impossible(frame),
            self._wrong_size(frame),
        )
        if self.frame_fault is None and self._judge is not None:
            self.frame_fault = self._judge(frame, state)
        if self.frame_fault is None:
            self._frame = frame

    def _wrong_size(self, frame: Frame) -> str | None:
        height_px, width_px = frame.image.shape[:2]
        if (width_px, height_px) == self._size_px:
            return None
        expected = "{}x{}".format(*self._size_px)
        return f"its image is {width_px}x{height_px}, expected {expected} as the camera's"

    def _late_or_early(self, captured_s: float, now_s: float) -> str | None:
        if math.isnan(captured_s) or captured_s - now_s > self._config.ahead_s:
            return f"its time is {captured_s - now_s:.1f} s in the future"
        return None

    def _impossible(self, report: DroneState | Frame) -> str | None:
        """Return the first value out of its bounds; None if all are within."""
        config = self._config
        bounds: list[tuple[str, Any, float]] = [
            ("roll", report.attitude.roll_rad, config.tilt_rad),
            ("pitch", report.attitude.pitch_rad, config.tilt_rad),
            ("yaw", report.attitude.yaw_rad, math.inf),
            ("gimbal pitch", report.gimbal_pitch_rad, math.pi),
            ("altitude", report.altitude_m, config.height_m),
            ("height", report.height_m, config.height_m),
            ("height above the ground", report.height_above_ground_m, config.height_m),
        ]
        if isinstance(report, DroneState):
            velocity = report.velocity
            bounds += [
                ("speed", velocity.forward_mps, config.speed_mps),
                ("speed", velocity.right_mps, config.speed_mps),
                ("vertical speed", velocity.down_mps, config.speed_mps),
            ]
            bounds += [
                (name, share, 1.0)
                for name, share in (("battery", report.battery), ("link", report.link))
                if share is not None
            ]
        for name, value, most in bounds:
            if not (math.isfinite(value) and abs(value) <= most):
                return f"its {name} is {value:g}"
        return None

    def _jump(self, state: DroneState) -> str | None:
        good = self._state
        if good is None:
            return None
        passed_s = max(0.0, state.times.altitude_s - good.times.altitude_s)
        max_m = self._config.altitude_noise_m + self._config.vertical_speed_mps * passed_s
        climbed_m = state.altitude_m - good.altitude_m
        if abs(climbed_m) > max_m:
            return f"its altitude changed by {climbed_m:.1f} m in {passed_s:.1f} s"
        return None


def _known(share: float | None) -> float | None:
    """Return a share from 0 to 1; None for a negative one, by which autopilots say unknown."""
    return None if share is not None and share < 0.0 else share


def _first(*faults: str | None) -> str | None:
    return next((fault for fault in faults if fault is not None), None)
