"""States that never change: the drone's identity and the condition of its sensors."""

from __future__ import annotations

from sim_bridge.loopback.firmware.publisher import Publisher
from sim_bridge.loopback.handshake import Identity
from sim_bridge.loopback.world import SATELLITES

_SENSORS = ("IMU", "barometer", "ultrasound", "GPS", "magnetometer", "vertical_camera")
_CALIBRATED = ("xAxisCalibration", "yAxisCalibration", "zAxisCalibration")
_FLIGHTS = ("nbFlights", "lastFlightDuration", "totalFlightDuration")


def publish_identity(publisher: Publisher, identity: Identity) -> None:
    """Publish the states that a client reads once.

    Args:
        publisher: publishes them.
        identity: name and serial number.
    """
    publish = publisher.state
    half = len(identity.serial) // 2
    publish("common.SettingsState.ProductVersionChanged", software="1.8.2", hardware="HW_00")
    publish("common.SettingsState.ProductSerialHighChanged", high=identity.serial[:half])
    publish("common.SettingsState.ProductSerialLowChanged", low=identity.serial[half:])
    publish("common.SettingsState.BoardIdChanged", id="loopback")
    publish("common.CommonState.BootId", bootId="loopback")
    publish("common.CommonState.LinkSignalQuality", value=5)
    publish("common.CommonState.WifiSignalChanged", rssi=-35)
    for sensor in _SENSORS:
        publish("common.CommonState.SensorsStatesListChanged", sensorName=sensor, sensorState=1)
    publish("common.RunState.RunIdChanged", runId="loopback")
    calibration = "common.CalibrationState.MagnetoCalibration"
    publish(f"{calibration}RequiredState", required=0)
    publish(f"{calibration}StartedChanged", started=0)
    publish(f"{calibration}StateChanged", **dict.fromkeys(_CALIBRATED, 1), calibrationFailed=0)
    publish("common.FlightPlanState.AvailabilityStateChanged", AvailabilityState=0)
    publish("ardrone3.GPSSettingsState.GPSFixStateChanged", fixed=1)
    publish("ardrone3.GPSState.NumberOfSatelliteChanged", numberOfSatellite=SATELLITES)
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
