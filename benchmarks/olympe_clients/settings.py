# ruff: noqa: S101 - as a user of the SDK would write it
"""Settings are taken within their bounds and confirmed, a hundred in a row, too."""

import os

import olympe
from olympe.messages import battery, rth
from olympe.messages.ardrone3.GPSSettingsState import GPSFixStateChanged, HomeChanged
from olympe.messages.ardrone3.PilotingSettings import MaxAltitude, MaxTilt
from olympe.messages.ardrone3.PilotingSettingsState import MaxTiltChanged
from olympe.messages.ardrone3.PilotingState import FlyingStateChanged, GpsLocationChanged
from olympe.messages.ardrone3.SpeedSettings import MaxRotationSpeed, MaxVerticalSpeed
from olympe.messages.common.Common import CurrentDateTime
from olympe.messages.common.CommonState import BatteryStateChanged
from olympe.messages.common.SettingsState import ProductNameChanged

drone = olympe.Drone(os.environ.get("DRONE_IP", "127.0.0.1"))
assert drone.connect()
for command in (
    MaxTilt(12),
    MaxAltitude(5),
    MaxVerticalSpeed(0.5),
    MaxRotationSpeed(60),
    CurrentDateTime(datetime="20260102T030405+0000"),
    rth.set_min_altitude(25.0),
    rth.set_delay(30),
    rth.set_ending_behavior(ending_behavior="hovering"),
):
    assert drone(command).wait(_timeout=5).success(), command
assert not drone(MaxTilt(0.5, _timeout=2)).wait().success()
assert drone.get_state(MaxTiltChanged)["current"] == drone.get_state(MaxTiltChanged)["min"]
assert drone.get_state(BatteryStateChanged)["percent"] > 0
assert drone.get_state(ProductNameChanged)["name"]
assert drone.get_state(FlyingStateChanged)["state"].name == "landed"
assert drone.get_state(GPSFixStateChanged)["fixed"] == 1
assert abs(drone.get_state(HomeChanged)["latitude"] - 48.8789) < 1e-3
assert drone(GpsLocationChanged(_policy="wait", _timeout=3)).wait().success()
assert drone.get_state(battery.alert)

for number in range(100):
    wanted = 5.0 + number % 20
    assert drone(MaxTilt(wanted)).wait(_timeout=10).success(), number
    assert drone.get_state(MaxTiltChanged)["current"] == wanted
assert drone.disconnect()
