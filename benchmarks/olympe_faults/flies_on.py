# ruff: noqa: S101 - as a user of the SDK would write it
"""Take off, say so, and hold the stick forward until killed."""

import os
import time

import olympe
from olympe.messages.ardrone3.Piloting import TakeOff
from olympe.messages.ardrone3.PilotingState import FlyingStateChanged

drone = olympe.Drone(os.environ["DRONE_IP"])
assert drone.connect()
assert drone(TakeOff() >> FlyingStateChanged(state="hovering", _timeout=15)).wait().success()
drone.start_piloting()
drone.piloting(0, 10, 0, 0, 60.0)
assert drone(FlyingStateChanged(state="flying", _timeout=5)).wait().success()
print("flying", flush=True)
time.sleep(60.0)
