"""What the drone tells over and over: attitude, speed, altitude, place, gimbal, link."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final

from sim_bridge.loopback.earth import place
from sim_bridge.loopback.firmware.announcer import Announcer
from sim_bridge.loopback.firmware.gimbal import Gimbal
from sim_bridge.loopback.firmware.part import Handler
from sim_bridge.loopback.world import WorldState

__all__ = ["Telemetry"]

_PERIOD_S: Final = 0.2  # s between two attitudes, as the ANAFI has it
_PILOTING: Final = "ardrone3.PilotingState"


class Telemetry:
    """Tells regularly, whether anything has changed or not."""

    def __init__(self, announcer: Announcer, gimbal: Gimbal) -> None:
        """Say nothing yet.

        Args:
            announcer: told.
            gimbal: knows what its pitch is relative to.
        """
        self._announcer = announcer
        self._gimbal = gimbal
        self._told_s = -math.inf

    def handlers(self) -> Mapping[str, Handler]:
        """Nothing to obey."""
        return {}

    def update(self, state: WorldState) -> None:
        """Tell what is due."""
        if state.time_s - self._told_s >= _PERIOD_S:
            # Late by a little must not become slower by a little.
            late = state.time_s - self._told_s < 2 * _PERIOD_S
            self._told_s = self._told_s + _PERIOD_S if late else state.time_s
            self._tell_motion(state)
            self._tell_gimbal(state)

    def _tell_motion(self, state: WorldState) -> None:
        tell, velocity, attitude = self._announcer.repeat, state.velocity, state.attitude
        cosine, sine = math.cos(attitude.yaw_rad), math.sin(attitude.yaw_rad)
        tell(
            f"{_PILOTING}.AttitudeChanged",
            roll=attitude.roll_rad,
            pitch=attitude.pitch_rad,
            yaw=attitude.yaw_rad,
        )
        tell(
            f"{_PILOTING}.SpeedChanged",
            speedX=velocity.forward_mps * cosine - velocity.right_mps * sine,
            speedY=velocity.forward_mps * sine + velocity.right_mps * cosine,
            speedZ=velocity.down_mps,
        )
        tell(f"{_PILOTING}.AltitudeChanged", altitude=state.altitude_m)
        tell(f"{_PILOTING}.AltitudeAboveGroundChanged", altitude=state.height_m)
        here = place(state.north_m, state.east_m, state.altitude_m)
        there = {
            "latitude": here.latitude_deg,
            "longitude": here.longitude_deg,
            "altitude": here.altitude_m,
        }
        tell(f"{_PILOTING}.PositionChanged", **there)
        tell(
            f"{_PILOTING}.GpsLocationChanged",
            **there,
            latitude_accuracy=1,
            longitude_accuracy=1,
            altitude_accuracy=1,
        )

    def _tell_gimbal(self, state: WorldState) -> None:
        pitch = math.degrees(state.gimbal_pitch_rad)
        self._announcer.repeat(
            "gimbal.attitude",
            gimbal_id=0,
            yaw_frame_of_reference="relative",
            pitch_frame_of_reference=self._gimbal.frame_of_reference,
            roll_frame_of_reference="absolute",
            yaw_relative=0.0,
            pitch_relative=pitch - math.degrees(state.attitude.pitch_rad),
            roll_relative=-math.degrees(state.attitude.roll_rad),
            yaw_absolute=math.degrees(state.attitude.yaw_rad),
            pitch_absolute=pitch,
            roll_absolute=0.0,
        )
