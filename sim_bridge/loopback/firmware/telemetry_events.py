"""Reports of the drone: identity, battery, and periodic telemetry of the motion."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from sim_bridge.loopback.firmware.camera import Gimbal
from sim_bridge.loopback.firmware.core import Core, Part
from sim_bridge.loopback.firmware.piloting import AIRBORNE, Flight
from sim_bridge.loopback.firmware.publisher import Publisher
from sim_bridge.loopback.handshake import Identity
from sim_bridge.loopback.world import (
    GROUND_M,
    LINK_QUALITY,
    RSSI_DBM,
    SATELLITES,
    UNKNOWN,
    WorldState,
    location,
)
from uav_bt.errors import ValueRangeError
from uav_bt.types import FlyingState, rotate

_SENSORS = ("IMU", "barometer", "ultrasound", "GPS", "magnetometer", "vertical_camera")
_CALIBRATED = ("xAxisCalibration", "yAxisCalibration", "zAxisCalibration")
_FLIGHTS = ("nbFlights", "lastFlightDuration", "totalFlightDuration")


def publish_identity(publisher: Publisher, identity: Identity, *, gps: bool) -> None:
    """Publish the states that a client reads once.

    Args:
        publisher: publishes the states.
        identity: name and serial number.
        gps: whether there is a GPS fix.
    """
    publish = publisher.state
    half = len(identity.serial) // 2
    publish("common.SettingsState.ProductVersionChanged", software="1.8.2", hardware="HW_00")
    publish("common.SettingsState.ProductSerialHighChanged", high=identity.serial[:half])
    publish("common.SettingsState.ProductSerialLowChanged", low=identity.serial[half:])
    publish("common.SettingsState.BoardIdChanged", id="loopback")
    publish("common.CommonState.BootId", bootId="loopback")
    publish("common.CommonState.LinkSignalQuality", value=LINK_QUALITY)
    publish("common.CommonState.WifiSignalChanged", rssi=RSSI_DBM)
    for sensor in _SENSORS:
        publish("common.CommonState.SensorsStatesListChanged", sensorName=sensor, sensorState=1)
    publish("common.RunState.RunIdChanged", runId="loopback")
    calibration = "common.CalibrationState.MagnetoCalibration"
    publish(f"{calibration}RequiredState", required=0)
    publish(f"{calibration}StartedChanged", started=0)
    publish(f"{calibration}StateChanged", **dict.fromkeys(_CALIBRATED, 1), calibrationFailed=0)
    publish("common.FlightPlanState.AvailabilityStateChanged", AvailabilityState=0)
    publish("ardrone3.GPSSettingsState.GPSFixStateChanged", fixed=int(gps))
    satellites = SATELLITES if gps else 0
    publish("ardrone3.GPSState.NumberOfSatelliteChanged", numberOfSatellite=satellites)
    publish("ardrone3.SettingsState.ProductGPSVersionChanged", software="1.0", hardware="1.0")
    publish("ardrone3.SettingsState.CPUID", id="loopback")
    publish("ardrone3.SettingsState.MotorErrorStateChanged", motorIds=0, motorError="noError")
    publish("ardrone3.SettingsState.MotorErrorLastErrorChanged", motorError="noError")
    publish("ardrone3.SettingsState.MotorFlightsStatusChanged", **dict.fromkeys(_FLIGHTS, 0))
    for event in ("WindStateChanged", "VibrationLevelChanged", "HeadingLockedStateChanged"):
        publish(f"ardrone3.PilotingState.{event}", state="ok")
    publish("ardrone3.PilotingState.HoveringWarning", no_gps_too_dark=0, no_gps_too_high=0)
    publish("ardrone3.PilotingState.ForcedLandingAutoTrigger", reason="NONE", delay=0)
    publish("ardrone3.PilotingState.ReturnHomeBatteryCapacity", status="OK")
    publish("ardrone3.PilotingState.MotionState", state="steady")
    publish("ardrone3.MediaStreamingState.VideoEnableChanged", enabled="enabled")
    publish("ardrone3.MediaStreamingState.VideoStreamModeChanged", mode="low_latency")
    publish("rth.home_type_capabilities", values={"takeoff", "custom"})
    publish("rth.rth_auto_trigger", reason="none", delay=0)
    publish("precise_home.capabilities", modes={"disabled"})
    publish("precise_home.state", state="unavailable")
    publish("piloting_style.capabilities", styles={"standard", "camera_operated"})


@dataclass(frozen=True, kw_only=True)
class BatteryOptions:
    """Charge, life and thresholds of the battery.

    Raises:
        ValueRangeError: a value is out of its range.
    """

    charge: float = 1.0  # 0 to 1, at the start and after each change of battery
    life_s: float = 1500.0  # flight time from full to empty: 25 minutes, as the ANAFI
    low: float = 0.2  # charge at which the drone warns
    critical: float = 0.1  # charge at which the drone lands automatically

    def __post_init__(self) -> None:
        if not (0.0 <= self.charge <= 1.0 and self.life_s > 0.0):
            raise ValueRangeError(
                f"a battery's charge lies within 0 and 1, its life is positive, got {self}"
            )


# Voltages of two cells in series, empty and full; linear in between.
_EMPTY_MV, _FULL_MV = 6600, 8700
_ALERTS: Final = (
    *("power_level", "too_hot", "too_cold"),
    *("gauge_too_old", "authentication_failure", "lost_comm"),
)


class Battery(Part):
    """Battery that drains in the air; a critical charge makes the drone land.

    Args:
        core: shared state of the parts.
        flight: lands the drone.
        options: charge, life and thresholds.
    """

    def __init__(self, core: Core, flight: Flight, options: BatteryOptions) -> None:
        super().__init__(core)
        self._flight = flight
        self._options = options
        self.charge = options.charge  # 0 to 1
        self._updated_s: float | None = None
        self._severity: str | None = None  # severity of the last power alert; None before the first
        core.publisher.state("battery.health", state_of_health=100)
        core.publisher.state("battery.cycle_count", count=1)
        core.publisher.state("battery.serial", serial="loopback")
        core.publisher.state("battery.reliability", is_charge_level_reliable=1)
        self._publish()

    def exchange(self) -> None:
        """Restore the charge of the start."""
        self.charge = self._options.charge
        self._publish()

    def update(self, state: WorldState) -> None:
        """Drain while the motors turn; land at a critical charge."""
        elapsed_s = 0.0 if self._updated_s is None else state.time_s - self._updated_s
        self._updated_s = state.time_s
        if state.flying in (*AIRBORNE, FlyingState.TAKING_OFF, FlyingState.LANDING):
            self.charge = max(0.0, self.charge - elapsed_s / self._options.life_s)
        self._publish()
        if self._severity == "critical" and state.flying in AIRBORNE:
            self._flight.land()

    def _publish(self) -> None:
        publisher = self._core.publisher
        percent = round(100.0 * self.charge)
        # Rounded to a per cent: a state that changes at every update would be sent at every update.
        voltage_mv = round(_EMPTY_MV + (_FULL_MV - _EMPTY_MV) * percent / 100.0)
        publisher.state("battery.voltage", voltage=voltage_mv)
        publisher.state("common.CommonState.BatteryStateChanged", percent=percent)
        severity, alert = "none", "none"
        if self.charge <= self._options.critical:
            severity, alert = "critical", "critical_battery"
        elif self.charge <= self._options.low:
            severity, alert = "warning", "low_battery"
        if severity == self._severity:
            return
        self._severity = severity
        self._flight.may_take_off = severity != "critical"
        publisher.state("ardrone3.PilotingState.AlertStateChanged", state=alert)
        levels = dict.fromkeys(_ALERTS, "none") | {"power_level": severity}
        publisher.entries(
            "battery.alert", [{"alert": name, "level": level} for name, level in levels.items()]
        )


_PERIOD_S: Final = 0.2  # s between two attitudes, as the ANAFI
_PILOTING: Final = "ardrone3.PilotingState"


class Telemetry(Part):
    """Publishes the motion periodically, changed or not.

    Args:
        core: shared state of the parts.
        gimbal: gives the frame of reference of the pitch.
    """

    def __init__(self, core: Core, gimbal: Gimbal) -> None:
        super().__init__(core)
        self._gimbal = gimbal
        self._published_s = -math.inf

    def update(self, state: WorldState) -> None:
        """Publish the telemetry that is due."""
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
        north, east = rotate(velocity.forward_mps, velocity.right_mps, attitude.yaw_rad)
        publish(f"{_PILOTING}.SpeedChanged", speedX=north, speedY=east, speedZ=velocity.down_mps)
        publish(f"{_PILOTING}.AltitudeChanged", altitude=state.altitude_m)
        publish(f"{_PILOTING}.AltitudeAboveGroundChanged", altitude=state.height_m)
        # This altitude is above sea level, unlike all others.
        position = location(state.north_m, state.east_m, GROUND_M + state.altitude_m).arguments
        if not self._core.gps:
            position = dict.fromkeys(position, UNKNOWN)
        publish(f"{_PILOTING}.PositionChanged", **position)
        accuracy_m = 1 if self._core.gps else -1
        accuracies = dict.fromkeys((f"{name}_accuracy" for name in position), accuracy_m)
        publish(f"{_PILOTING}.GpsLocationChanged", **position, **accuracies)

    def _publish_gimbal(self, state: WorldState) -> None:
        pitch_deg = math.degrees(state.gimbal_pitch_rad)
        self._core.publisher.refresh(
            "gimbal.attitude",
            gimbal_id=0,
            yaw_frame_of_reference="relative",
            pitch_frame_of_reference=self._gimbal.reference,
            roll_frame_of_reference="absolute",
            yaw_relative=0.0,
            pitch_relative=pitch_deg - math.degrees(state.attitude.pitch_rad),
            roll_relative=-math.degrees(state.attitude.roll_rad),
            yaw_absolute=math.degrees(state.attitude.yaw_rad),
            pitch_absolute=pitch_deg,
            roll_absolute=0.0,
        )
