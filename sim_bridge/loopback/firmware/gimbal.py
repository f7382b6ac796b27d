"""The camera's gimbal: targets as positions or velocities, bounds, and its attitude."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final

from sim_bridge.loopback.firmware.announcer import Announcer
from sim_bridge.loopback.firmware.part import Handler, Values
from sim_bridge.loopback.firmware.settings import Settings
from sim_bridge.loopback.world import World, WorldState

__all__ = ["Gimbal"]

_LOWEST_DEG: Final = -90.0  # the ANAFI's own range, which the picture of the twin has, too
_HIGHEST_DEG: Final = 90.0
_SPEED: Final = "gimbal.max_speed"


class Gimbal:
    """Points the camera up and down; yaw stays ahead and roll level."""

    def __init__(self, announcer: Announcer, world: World, settings: Settings) -> None:
        """Look ahead.

        Args:
            announcer: told what the gimbal can do.
            world: what carries the camera.
            settings: the greatest speed.
        """
        self._announcer = announcer
        self._world = world
        self._settings = settings
        self._speed_degps = 0.0
        self._updated_s = 0.0
        self._target_deg = 0.0
        self._reference = "absolute"
        self._tell_abilities()

    @property
    def frame_of_reference(self) -> str:
        """What the pitch was last said to be relative to."""
        return self._reference

    def handlers(self) -> Mapping[str, Handler]:
        """Return what obeys which command."""
        return {
            "gimbal.set_target": self._set_target,
            "gimbal.reset_orientation": self._reset,
            "gimbal.calibrate": self._calibrate,
            "gimbal.cancel_calibration": self._cancel_calibration,
            "gimbal.start_offsets_update": lambda _, __: self._offsets("active"),
            "gimbal.stop_offsets_update": lambda _, __: self._offsets("inactive"),
        }

    def update(self, state: WorldState) -> None:
        """Move on where a velocity is set."""
        elapsed, self._updated_s = state.time_s - self._updated_s, state.time_s
        if self._speed_degps:
            self._point(self._target_deg + self._speed_degps * elapsed)
            if self._target_deg in (_LOWEST_DEG, _HIGHEST_DEG):
                self._speed_degps = 0.0

    def _set_target(self, values: Values, state: WorldState) -> None:
        reference, pitch = values["pitch_frame_of_reference"], values["pitch"]
        if values["gimbal_id"] != 0 or not math.isfinite(pitch):
            return
        if values["control_mode"] == "velocity":
            share = max(-1.0, min(1.0, pitch))
            self._speed_degps = share * self._settings.value(_SPEED, "current_pitch")
            self._target_deg = math.degrees(state.gimbal_pitch_rad)
        elif reference != "none":
            self._speed_degps = 0.0
            self._reference = reference
            lean = math.degrees(state.attitude.pitch_rad) if reference == "relative" else 0.0
            self._point(pitch + lean)

    def _point(self, pitch_deg: float) -> None:
        self._target_deg = max(_LOWEST_DEG, min(_HIGHEST_DEG, pitch_deg))
        self._world.point(math.radians(self._target_deg))

    def _reset(self, values: Values, state: WorldState) -> None:
        del values, state
        self._speed_degps = 0.0
        self._point(0.0)

    def _calibrate(self, values: Values, state: WorldState) -> None:
        del values, state
        tell = self._announcer.repeat
        tell("gimbal.calibration_state", state="in_progress", gimbal_id=0)
        self._announcer.note("gimbal.calibration_result", gimbal_id=0, result="success")
        tell("gimbal.calibration_state", state="ok", gimbal_id=0)

    def _cancel_calibration(self, values: Values, state: WorldState) -> None:
        del values, state
        self._announcer.note("gimbal.calibration_result", gimbal_id=0, result="canceled")

    def _offsets(self, update_state: str) -> None:
        self._settings.change("gimbal.offsets", update_state=update_state)

    def _tell_abilities(self) -> None:
        tell = self._announcer.state
        tell("gimbal.gimbal_capabilities", gimbal_id=0, model="main", axes={"roll", "pitch"})
        bounds = {
            "gimbal_id": 0,
            "min_yaw": 0.0,
            "max_yaw": 0.0,
            "min_pitch": _LOWEST_DEG,
            "max_pitch": _HIGHEST_DEG,
            "min_roll": 0.0,
            "max_roll": 0.0,
        }
        tell("gimbal.relative_attitude_bounds", **bounds)
        tell("gimbal.absolute_attitude_bounds", **bounds)
        tell("gimbal.axis_lock_state", gimbal_id=0, locked={"yaw"})
        tell("gimbal.calibration_state", state="ok", gimbal_id=0)
        tell("gimbal.alert", gimbal_id=0, error=set())
