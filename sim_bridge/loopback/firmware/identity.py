"""What never changes: who the drone is and what its sensors say of themselves."""

from __future__ import annotations

from sim_bridge.loopback.firmware.announcer import Announcer
from sim_bridge.loopback.handshake import Identity

__all__ = ["tell_identity"]

_SENSORS = ("IMU", "barometer", "ultrasound", "GPS", "magnetometer", "vertical_camera")
_SATELLITES = 14


def tell_identity(announcer: Announcer, identity: Identity) -> None:
    """Tell what a client asks once.

    Args:
        announcer: told.
        identity: name and serial number.
    """
    tell = announcer.state
    half = len(identity.serial) // 2
    tell("common.SettingsState.ProductVersionChanged", software="1.8.2", hardware="HW_00")
    tell("common.SettingsState.ProductSerialHighChanged", high=identity.serial[:half])
    tell("common.SettingsState.ProductSerialLowChanged", low=identity.serial[half:])
    tell("common.SettingsState.BoardIdChanged", id="loopback")
    tell("common.CommonState.BootId", bootId="loopback")
    tell("common.CommonState.LinkSignalQuality", value=5)
    tell("common.CommonState.WifiSignalChanged", rssi=-35)
    for sensor in _SENSORS:
        tell("common.CommonState.SensorsStatesListChanged", sensorName=sensor, sensorState=1)
    tell("common.RunState.RunIdChanged", runId="loopback")
    tell("common.CalibrationState.MagnetoCalibrationRequiredState", required=0)
    tell("common.CalibrationState.MagnetoCalibrationStartedChanged", started=0)
    tell(
        "common.CalibrationState.MagnetoCalibrationStateChanged",
        xAxisCalibration=1,
        yAxisCalibration=1,
        zAxisCalibration=1,
        calibrationFailed=0,
    )
    tell("common.FlightPlanState.AvailabilityStateChanged", AvailabilityState=0)
    tell("ardrone3.GPSSettingsState.GPSFixStateChanged", fixed=1)
    tell("ardrone3.GPSState.NumberOfSatelliteChanged", numberOfSatellite=_SATELLITES)
    tell("ardrone3.SettingsState.ProductGPSVersionChanged", software="1.0", hardware="1.0")
    tell("ardrone3.SettingsState.CPUID", id="loopback")
    tell("ardrone3.SettingsState.MotorErrorStateChanged", motorIds=0, motorError="noError")
    tell("ardrone3.SettingsState.MotorErrorLastErrorChanged", motorError="noError")
    tell(
        "ardrone3.SettingsState.MotorFlightsStatusChanged",
        nbFlights=0,
        lastFlightDuration=0,
        totalFlightDuration=0,
    )
    for event in ("WindStateChanged", "VibrationLevelChanged", "HeadingLockedStateChanged"):
        tell(f"ardrone3.PilotingState.{event}", state="ok")
    tell("ardrone3.PilotingState.HoveringWarning", no_gps_too_dark=0, no_gps_too_high=0)
    tell("ardrone3.PilotingState.ForcedLandingAutoTrigger", reason="NONE", delay=0)
    tell("ardrone3.PilotingState.ReturnHomeBatteryCapacity", status="OK")
    tell("ardrone3.PilotingState.MotionState", state="steady")
    tell("ardrone3.MediaStreamingState.VideoEnableChanged", enabled="enabled")
    tell("ardrone3.MediaStreamingState.VideoStreamModeChanged", mode="low_latency")
    tell("rth.home_type_capabilities", values={"takeoff", "custom"})
    tell("rth.rth_auto_trigger", reason="none", delay=0)
    tell("precise_home.capabilities", modes={"disabled"})
    tell("precise_home.state", state="unavailable")
    tell("piloting_style.capabilities", styles={"standard", "camera_operated"})
