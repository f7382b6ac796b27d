"""What a drone reports, checked at the door: a measurement that cannot be is no measurement.

It takes the age of the last good one, so that the rules about old telemetry and old frames
(`uav_bt.mission.safety`) hold for it as they do when nothing comes at all.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from uav_bt.types import CameraModel, DroneState, Frame, Observation

FrameJudge = Callable[[Frame, DroneState], str | None]
"""Says why a frame is not fit to fly by, None when it is."""


@dataclass(frozen=True, kw_only=True)
class ScreeningConfig:
    """What a small camera drone can report.

    Attributes:
        tilt_rad: roll and pitch, at most.
        height_m: above or below anything, at most.
        speed_mps: at most.
        vertical_speed_mps: the fastest change of the altitude between two reports ...
        altitude_noise_m: ... beyond this: barometers are slow to forget a gust or a door.
        ahead_s: how far a time of capture may lie in the future: two clocks differ a little.
    """

    tilt_rad: float = math.pi / 2
    height_m: float = 150.0
    speed_mps: float = 20.0
    vertical_speed_mps: float = 4.0
    altitude_noise_m: float = 1.6
    ahead_s: float = 0.5


class Screening:
    """Passes on what can be flown by, and the last such thing where something cannot.

    Args:
        camera: intrinsics at the size that frames must have.
        judge: looks at the image of each new frame; None trusts them all.
        config: what can be.
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
        self._newest: tuple[int, float] | None = None  # the frame that was looked at last
        self.state_fault: str | None = None  # why the newest telemetry was refused
        self.frame_fault: str | None = None  # why the newest frame was refused

    @property
    def refused(self) -> tuple[str, ...]:
        """What of the newest report was refused, and why."""
        faults = (("frame", self.frame_fault), ("telemetry", self.state_fault))
        return tuple(f"{what}: {fault}" for what, fault in faults if fault is not None)

    def usable(self, observation: Observation, now_s: float) -> Observation:
        """Return an observation of which every measurement can be.

        Args:
            observation: the drone's.
            now_s: mission clock.
        """
        state = self._usable_state(observation.state, now_s)
        self._take_frame(observation.frame, state, now_s)
        return Observation(frame=self._frame, state=state)

    def _usable_state(self, state: DroneState, now_s: float) -> DroneState:
        self.state_fault = _first(
            self._late_or_early(state.captured_s, now_s),
            self._impossible(state),
            self._jump(state),
        )
        if self.state_fault is None:
            self._state = state
            return state
        good = self._state or DroneState(captured_s=-math.inf, flying=state.flying)
        # What it says of itself in words is believed: a landing must be recognised.
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
        """Return the first value that cannot be, None when all can."""
        config = self._config
        bounds: list[tuple[str, Any, float]] = [
            ("roll", report.attitude.roll_rad, config.tilt_rad),
            ("pitch", report.attitude.pitch_rad, config.tilt_rad),
            ("yaw", report.attitude.yaw_rad, math.inf),
            ("gimbal pitch", report.gimbal_pitch_rad, math.pi),
            ("altitude", report.altitude_m, config.height_m),
            ("height", report.height_m, config.height_m),
            ("height above the carpet", report.height_above_carpet_m, config.height_m),
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
        passed_s = max(0.0, state.captured_s - good.captured_s)
        max_m = self._config.altitude_noise_m + self._config.vertical_speed_mps * passed_s
        climbed_m = state.altitude_m - good.altitude_m
        if abs(climbed_m) > max_m:
            return f"its altitude changed by {climbed_m:.1f} m in {passed_s:.1f} s"
        return None


def _first(*faults: str | None) -> str | None:
    return next((fault for fault in faults if fault is not None), None)
