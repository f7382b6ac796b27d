"""Zoom of the camera; its level applies to the video and the photographs."""

from __future__ import annotations

import math
from typing import Final

from sim_bridge.anafi import FOCAL_SHARE
from sim_bridge.loopback.firmware.core import Core, Part
from sim_bridge.loopback.firmware.publisher import Values
from sim_bridge.loopback.world import WorldState
from uav_bt.types.pose import clamp

_MAX_LEVEL: Final = 3.0  # as the ANAFI
_MAX_LOSSLESS_LEVEL: Final = 2.8  # as the ANAFI, for video of 1080 lines
_PERIOD_S: Final = 0.2  # s between two published levels during a change
_HALF_VIEW: Final = 0.5 / FOCAL_SHARE  # tangent of half the horizontal field of view at level 1


class Zoom(Part):
    """Sets the level at once, or changes it at a speed up to its bound."""

    def __init__(self, core: Core) -> None:
        super().__init__(core)
        self.handlers = {
            "camera.set_zoom_target": self._set_target,
            "camera.reset_zoom": self._reset,
        }
        self.level = 1.0  # factor of the focal length
        self._share = 0.0  # share of the largest speed, -1 to 1
        self._updated_s = self._published_s = 0.0
        core.publisher.state(
            "camera.zoom_info",
            cam_id=0,
            available="available",
            high_quality_maximum_level=_MAX_LOSSLESS_LEVEL,
            maximum_level=_MAX_LEVEL,
        )
        self._publish(0.0)

    def update(self, state: WorldState) -> None:
        """Integrate the speed if one is set."""
        elapsed_s, self._updated_s = state.time_s - self._updated_s, state.time_s
        if not self._share:
            return
        value = self._core.settings.value
        degraded = value("camera.zoom_velocity_quality_degradation", "allowed")
        top = _MAX_LEVEL if degraded else max(self.level, _MAX_LOSSLESS_LEVEL)
        # The speed applies to the tangent of half the field of view; zooming in reduces it.
        tangent = _HALF_VIEW / self.level
        tangent -= self._share * value("camera.max_zoom_speed") * elapsed_s
        self.level = _HALF_VIEW / min(_HALF_VIEW, max(_HALF_VIEW / top, tangent))
        ended = self.level == (top if self._share > 0.0 else 1.0)
        if ended:
            self._share = 0.0
        if ended or state.time_s - self._published_s >= _PERIOD_S:
            self._publish(state.time_s)

    def _set_target(self, values: Values, state: WorldState) -> None:
        target = values["target"]
        if values["cam_id"] != 0 or not math.isfinite(target):
            return
        if values["control_mode"] == "velocity":
            self._share = clamp(target, 1.0)
            return
        self._share = 0.0
        self.level = max(1.0, min(_MAX_LEVEL, target))
        self._publish(state.time_s)

    def _reset(self, values: Values, state: WorldState) -> None:
        if values["cam_id"] == 0:
            self._share, self.level = 0.0, 1.0
            self._publish(state.time_s)

    def _publish(self, time_s: float) -> None:
        self._published_s = time_s
        self._core.publisher.refresh("camera.zoom_level", cam_id=0, level=self.level)
