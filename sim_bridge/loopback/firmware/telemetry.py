"""Battery, and periodic telemetry of the motion."""

from __future__ import annotations

import math
from typing import Final

from sim_bridge.loopback.firmware.flight import AIRBORNE, Flight
from sim_bridge.loopback.world import GROUND_M, SATELLITES, WorldState, location
from uav_bt.types import FlyingState, rotate

_LIFE_S: Final = 1500.0  # flight time from full to empty: 25 minutes, as the ANAFI
_LOW: Final = 0.2  # charge at which the drone warns
_CRITICAL: Final = 0.1  # charge at which the drone lands automatically
# Voltages of two cells in series, empty and full; linear in between.
_EMPTY_MV, _FULL_MV = 6600, 8700


class Battery:
    """Battery that drains in the air; a critical charge makes the drone land."""

    def __init__(self, flight: Flight, charge: float) -> None:
        self._flight = flight
        self._first = charge  # 0 to 1, at the start and after each change of battery
        self.charge = charge
        self._updated_s = 0.0
        self._publish()

    def exchange(self) -> None:
        """Restore the charge of the start."""
        self.charge = self._first
        self._publish()

    def update(self, state: WorldState) -> None:
        """Drain while the motors turn; land at a critical charge."""
        elapsed_s, self._updated_s = state.captured_s - self._updated_s, state.captured_s
        if state.flying in (*AIRBORNE, FlyingState.TAKING_OFF, FlyingState.LANDING):
            self.charge = max(0.0, self.charge - elapsed_s / _LIFE_S)
            self._publish()
        if self.charge <= _CRITICAL and state.flying in AIRBORNE:
            self._flight.land()

    def _publish(self) -> None:
        publish, percent = self._flight.states.set, round(100.0 * self.charge)
        # Rounded to a per cent: a state that changes at every update would be sent at every update.
        voltage_mv = round(_EMPTY_MV + (_FULL_MV - _EMPTY_MV) * percent / 100.0)
        publish("battery.voltage", voltage=voltage_mv)
        publish("common.CommonState.BatteryStateChanged", percent=percent)
        level, alert = "none", "none"
        if self.charge <= _CRITICAL:
            level, alert = "critical", "critical_battery"
        elif self.charge <= _LOW:
            level, alert = "warning", "low_battery"
        self._flight.may_take_off = level != "critical"
        publish("ardrone3.PilotingState.AlertStateChanged", state=alert)
        publish("battery.alert", level=level)


_PERIOD_S: Final = 0.2  # s between two attitudes, as the ANAFI
_PILOTING: Final = "ardrone3.PilotingState"


class Telemetry:
    """Publishes the motion periodically, changed or not."""

    def __init__(self, flight: Flight) -> None:
        self._states = flight.states
        self._fix = flight.world.outdoors
        self._published_s = -math.inf
        if self._fix:
            self._states.set("ardrone3.GPSSettingsState.GPSFixStateChanged", fixed=1)
            event = "ardrone3.GPSState.NumberOfSatelliteChanged"
            self._states.set(event, numberOfSatellite=SATELLITES)

    def update(self, state: WorldState) -> None:
        """Publish the telemetry that is due."""
        elapsed_s = state.captured_s - self._published_s
        if elapsed_s >= _PERIOD_S:
            # A small delay must not lengthen the period.
            late = elapsed_s < 2 * _PERIOD_S
            self._published_s = self._published_s + _PERIOD_S if late else state.captured_s
            self._publish_motion(state)
            self._publish_gimbal(state)

    def _publish_motion(self, state: WorldState) -> None:
        publish, velocity, attitude = self._states.refresh, state.velocity, state.attitude
        publish(
            f"{_PILOTING}.AttitudeChanged",
            roll=attitude.roll_rad,
            pitch=attitude.pitch_rad,
            yaw=attitude.yaw_rad,
        )
        north, east = rotate(velocity.forward_mps, velocity.right_mps, attitude.yaw_rad)
        publish(f"{_PILOTING}.SpeedChanged", speedX=north, speedY=east, speedZ=velocity.down_mps)
        publish(f"{_PILOTING}.AltitudeChanged", altitude=state.altitude_m)
        publish(f"{_PILOTING}.AltitudeAboveGroundChanged", altitude=state.height_m)
        position: dict[str, float] = {}
        accuracies: dict[str, int] = {}
        if self._fix:
            # This altitude is above sea level, unlike all others.
            position = location(state.north_m, state.east_m, GROUND_M + state.altitude_m).arguments
            accuracies = dict.fromkeys((f"{name}_accuracy" for name in position), 1)
        publish(f"{_PILOTING}.PositionChanged", **position)
        publish(f"{_PILOTING}.GpsLocationChanged", **position, **accuracies)

    def _publish_gimbal(self, state: WorldState) -> None:
        pitch_deg = math.degrees(state.gimbal_pitch_rad)
        self._states.refresh(
            "gimbal.attitude",
            pitch_relative=pitch_deg - math.degrees(state.attitude.pitch_rad),
            roll_relative=-math.degrees(state.attitude.roll_rad),
            yaw_absolute=math.degrees(state.attitude.yaw_rad),
            pitch_absolute=pitch_deg,
        )
