"""The camera's gimbal: targets as positions or velocities, bounds, calibration."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final

from sim_bridge.loopback.firmware.part import Core, Part
from sim_bridge.loopback.firmware.publisher import Handler, Values
from sim_bridge.loopback.world import WorldState

_MIN_DEG: Final = -90.0  # the ANAFI's range, which the twin's camera has, too
_MAX_DEG: Final = 90.0
_BOUNDS: Final = {
    "gimbal_id": 0,
    **dict.fromkeys(("min_yaw", "max_yaw", "min_roll", "max_roll"), 0.0),
    "min_pitch": _MIN_DEG,
    "max_pitch": _MAX_DEG,
}


class Gimbal(Part):
    """Points the camera up and down; its yaw is the body's, and its roll is level.

    Args:
        core: what the parts share.
    """

    def __init__(self, core: Core) -> None:
        super().__init__(core)
        self._speed_degps = 0.0
        self._updated_s = 0.0
        self._target_deg = 0.0
        self._reference = "absolute"
        publish = core.publisher.state
        publish("gimbal.gimbal_capabilities", gimbal_id=0, model="main", axes={"roll", "pitch"})
        publish("gimbal.relative_attitude_bounds", **_BOUNDS)
        publish("gimbal.absolute_attitude_bounds", **_BOUNDS)
        publish("gimbal.axis_lock_state", gimbal_id=0, locked={"yaw"})
        publish("gimbal.calibration_state", state="ok", gimbal_id=0)
        publish("gimbal.alert", gimbal_id=0, error=set())

    @property
    def frame_of_reference(self) -> str:
        """The frame in which the last target was given: absolute or relative."""
        return self._reference

    def handlers(self) -> Mapping[str, Handler]:
        """Return the commands it handles, by name."""
        return {
            "gimbal.set_target": self._set_target,
            "gimbal.reset_orientation": self._reset,
            "gimbal.calibrate": self._calibrate,
            "gimbal.cancel_calibration": self._cancel_calibration,
            "gimbal.start_offsets_update": lambda _, __: self._update_offsets("active"),
            "gimbal.stop_offsets_update": lambda _, __: self._update_offsets("inactive"),
        }

    def update(self, state: WorldState) -> None:
        """Integrate the velocity, where one is set."""
        elapsed_s, self._updated_s = state.time_s - self._updated_s, state.time_s
        if self._speed_degps:
            self._point(self._target_deg + self._speed_degps * elapsed_s)
            if self._target_deg in (_MIN_DEG, _MAX_DEG):
                self._speed_degps = 0.0

    def _set_target(self, values: Values, state: WorldState) -> None:
        reference, pitch = values["pitch_frame_of_reference"], values["pitch"]
        if values["gimbal_id"] != 0 or not math.isfinite(pitch):
            return
        if values["control_mode"] == "velocity":
            share = max(-1.0, min(1.0, pitch))
            max_degps = self._core.settings.value("gimbal.max_speed", "current_pitch")
            self._speed_degps = share * max_degps
            self._target_deg = math.degrees(state.gimbal_pitch_rad)
        elif reference != "none":
            self._speed_degps = 0.0
            self._reference = reference
            body_deg = math.degrees(state.attitude.pitch_rad) if reference == "relative" else 0.0
            self._point(pitch + body_deg)

    def _point(self, pitch_deg: float) -> None:
        self._target_deg = max(_MIN_DEG, min(_MAX_DEG, pitch_deg))
        self._core.world.point(math.radians(self._target_deg))

    def _reset(self, _values: Values, _state: WorldState) -> None:
        self._speed_degps = 0.0
        self._point(0.0)

    def _calibrate(self, _values: Values, _state: WorldState) -> None:
        publisher = self._core.publisher
        publisher.refresh("gimbal.calibration_state", state="in_progress", gimbal_id=0)
        publisher.notify("gimbal.calibration_result", gimbal_id=0, result="success")
        publisher.refresh("gimbal.calibration_state", state="ok", gimbal_id=0)

    def _cancel_calibration(self, _values: Values, _state: WorldState) -> None:
        self._core.publisher.notify("gimbal.calibration_result", gimbal_id=0, result="canceled")

    def _update_offsets(self, update_state: str) -> None:
        self._core.settings.change("gimbal.offsets", update_state=update_state)
