# ruff: noqa: S101, ANN001, ANN201 - as a user of the SDK would write it
"""Start, fly and end as ROS drivers for the ANAFI do: read states, set limits, stream, steer."""

import os
import time

import olympe
from olympe.messages import battery, camera, gimbal, mediastore, rth, user_storage
from olympe.messages.ardrone3.GPSSettingsState import GPSFixStateChanged
from olympe.messages.ardrone3.GPSState import NumberOfSatelliteChanged
from olympe.messages.ardrone3.Piloting import Landing, TakeOff
from olympe.messages.ardrone3.PilotingEvent import moveByEnd
from olympe.messages.ardrone3.PilotingSettings import MaxAltitude, MaxTilt
from olympe.messages.ardrone3.PilotingSettingsState import MaxTiltChanged
from olympe.messages.ardrone3.PilotingState import (
    AltitudeChanged,
    AttitudeChanged,
    FlyingStateChanged,
    GpsLocationChanged,
    HoveringWarning,
    SpeedChanged,
)
from olympe.messages.ardrone3.SettingsState import MotorErrorStateChanged
from olympe.messages.ardrone3.SpeedSettings import MaxRotationSpeed, MaxVerticalSpeed
from olympe.messages.common.CalibrationState import MagnetoCalibrationRequiredState
from olympe.messages.common.CommonState import BatteryStateChanged, LinkSignalQuality
from olympe.messages.common.SettingsState import ProductVersionChanged
from olympe.messages.move import extended_move_by

READ_AT_START = (
    *(AltitudeChanged, AttitudeChanged, FlyingStateChanged, GpsLocationChanged, SpeedChanged),
    *(BatteryStateChanged, LinkSignalQuality, ProductVersionChanged, HoveringWarning),
    *(GPSFixStateChanged, NumberOfSatelliteChanged, MotorErrorStateChanged),
    *(MagnetoCalibrationRequiredState, rth.state, rth.home_reachability, rth.auto_trigger_mode),
    *(battery.health, gimbal.attitude, gimbal.max_speed, camera.zoom_level, camera.camera_mode),
    *(battery.voltage, battery.serial, camera.zoom_info, camera.exposure),
    *(mediastore.state, mediastore.counters, user_storage.info, user_storage.state),
)

drone = olympe.Drone(os.environ.get("DRONE_IP", "127.0.0.1"))
heard: dict[str, int] = {}


def count(event, _scheduler):
    """Note an event, as a driver publishes it."""
    heard[event.message.fullName] = heard.get(event.message.fullName, 0) + 1


drone.subscribe(count, None)
assert drone.connect()
time.sleep(1.0)  # states that are sent now and then
for message in READ_AT_START:
    assert drone.get_state(message) is not None, message

bounds = drone.get_state(MaxTiltChanged)
assert (bounds["min"], bounds["max"]) == (1.0, 40.0), bounds
for setting in (
    *(MaxTilt(10.0), MaxAltitude(5.0), MaxVerticalSpeed(1.0), MaxRotationSpeed(60.0)),
    rth.set_auto_trigger_mode("off"),
    camera.set_camera_mode(cam_id=0, value="recording"),
    gimbal.set_max_speed(gimbal_id=0, yaw=0.0, pitch=180.0, roll=0.0),
):
    assert drone(setting).wait(_timeout=5).success(), setting

assert drone(TakeOff() >> FlyingStateChanged(state="hovering", _timeout=10)).wait().success()

# At a speed of its own, which the drone keeps.
begun = time.monotonic()
moved = drone(
    extended_move_by(1.0, 0.0, 0.0, 0.0, 0.25, 0.5, 30.0)
    >> moveByEnd(error="ok", _policy="wait", _timeout=20)
).wait()
assert moved.success(), moved.explain()
took_s = time.monotonic() - begun
assert took_s > 3.5, f"1 m at 0.25 m/s in {took_s:.1f} s"

# By its sticks, again and again, then hands off.
for _ in range(20):
    assert drone.piloting(0, 20, 10, 0, 0.1)
    time.sleep(0.05)
drone.stop_piloting()
assert drone(FlyingStateChanged(state="hovering", _timeout=10, _policy="check_wait")).wait()
assert drone(Landing() >> FlyingStateChanged(state="landed", _timeout=15)).wait().success()
assert heard["ardrone3.PilotingState.AttitudeChanged"] > 30, heard
assert drone.disconnect()
print(f"{len(heard)} kinds of events, 1 m in {took_s:.1f} s")
