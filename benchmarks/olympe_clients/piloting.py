# ruff: noqa: S101 - as a user of the SDK would write it
"""Fly by the sticks: forward, round, up; then they fall silent and the drone hovers."""

import os
import time

import olympe
from olympe.messages.ardrone3.Piloting import PCMD, Landing, TakeOff
from olympe.messages.ardrone3.PilotingSettings import MaxTilt
from olympe.messages.ardrone3.PilotingState import (
    AltitudeChanged,
    AttitudeChanged,
    FlyingStateChanged,
    SpeedChanged,
)

drone = olympe.Drone(os.environ.get("DRONE_IP", "127.0.0.1"))
assert drone.connect()
assert drone(MaxTilt(10)).wait().success()
assert drone(TakeOff() >> FlyingStateChanged(state="hovering", _timeout=10)).wait().success()
drone.start_piloting()
before = drone.get_state(AttitudeChanged)["yaw"]
drone.piloting(0, 50, 0, 0, 1.5)
assert drone(FlyingStateChanged(state="flying", _timeout=5)).wait().success()
time.sleep(1.2)
speed = drone.get_state(SpeedChanged)
assert speed["speedX"] ** 2 + speed["speedY"] ** 2 > 0.3**2, speed
assert drone(FlyingStateChanged(state="hovering", _timeout=5)).wait().success()
drone.piloting(0, 0, 100, 0, 1.0)
time.sleep(1.5)
turned = (drone.get_state(AttitudeChanged)["yaw"] - before + 3.1416) % 6.2832 - 3.1416
assert turned > 0.3, turned
low = drone.get_state(AltitudeChanged)["altitude"]
drone.piloting(0, 0, 0, 50, 1.0)
time.sleep(1.5)
assert drone.get_state(AltitudeChanged)["altitude"] > low + 0.2
drone.stop_piloting()

# One single order of the sticks does not fly on for ever.
assert drone(FlyingStateChanged(state="hovering", _timeout=5)).wait().success()
drone(PCMD(1, 0, 60, 0, 0, 0))
assert drone(FlyingStateChanged(state="flying", _policy="wait", _timeout=5)).wait().success()
assert drone(FlyingStateChanged(state="hovering", _policy="wait", _timeout=5)).wait().success()
assert drone(Landing() >> FlyingStateChanged(state="landed", _timeout=15)).wait().success()
assert drone.disconnect()
