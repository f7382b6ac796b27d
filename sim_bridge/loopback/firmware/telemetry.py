"""Periodic states: attitude, speed, altitude, position, gimbal."""

from __future__ import annotations

import math
from typing import Final

from sim_bridge.loopback.firmware.gimbal import Gimbal
from sim_bridge.loopback.firmware.part import Core, Part
from sim_bridge.loopback.world import WorldState, location, to_earth

_PERIOD_S: Final = 0.2  # s between two attitudes, as the ANAFI has it
_PILOTING: Final = "ardrone3.PilotingState"


class Telemetry(Part):
    """Publishes periodically, whether anything has changed or not.

    Args:
        core: what the parts share.
        gimbal: knows the frame of reference of its pitch.
    """

    def __init__(self, core: Core, gimbal: Gimbal) -> None:
        super().__init__(core)
        self._gimbal = gimbal
        self._published_s = -math.inf

    def update(self, state: WorldState) -> None:
        """Publish what is due."""
        elapsed_s = state.time_s - self._published_s
        if elapsed_s >= _PERIOD_S:
            # A small delay must not lengthen the period.
            late = elapsed_s < 2 * _PERIOD_S
            self._published_s = self._published_s + _PERIOD_S if late else state.time_s
            self._publish_motion(state)
            self._publish_gimbal(state)

    def _publish_motion(self, state: WorldState) -> None:
        publish, velocity, attitude = self._core.publisher.refresh, state.velocity, state.attitude
        publish(
            f"{_PILOTING}.AttitudeChanged",
            roll=attitude.roll_rad,
            pitch=attitude.pitch_rad,
            yaw=attitude.yaw_rad,
        )
        north, east = to_earth(velocity.forward_mps, velocity.right_mps, attitude.yaw_rad)
        publish(f"{_PILOTING}.SpeedChanged", speedX=north, speedY=east, speedZ=velocity.down_mps)
        publish(f"{_PILOTING}.AltitudeChanged", altitude=state.altitude_m)
        publish(f"{_PILOTING}.AltitudeAboveGroundChanged", altitude=state.height_m)
        position = location(state.north_m, state.east_m, state.altitude_m).arguments
        publish(f"{_PILOTING}.PositionChanged", **position)
        accuracies = dict.fromkeys((f"{name}_accuracy" for name in position), 1)
        publish(f"{_PILOTING}.GpsLocationChanged", **position, **accuracies)

    def _publish_gimbal(self, state: WorldState) -> None:
        pitch_deg = math.degrees(state.gimbal_pitch_rad)
        self._core.publisher.refresh(
            "gimbal.attitude",
            gimbal_id=0,
            yaw_frame_of_reference="relative",
            pitch_frame_of_reference=self._gimbal.frame_of_reference,
            roll_frame_of_reference="absolute",
            yaw_relative=0.0,
            pitch_relative=pitch_deg - math.degrees(state.attitude.pitch_rad),
            roll_relative=-math.degrees(state.attitude.roll_rad),
            yaw_absolute=math.degrees(state.attitude.yaw_rad),
            pitch_absolute=pitch_deg,
            roll_absolute=0.0,
        )
