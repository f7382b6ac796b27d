# ruff: noqa: S101 - as a user of the SDK would write it
"""Take off, say so, and wait until the drone is gone; then find the next one at its address."""

import os
import time

import olympe
from olympe.messages.ardrone3.Piloting import TakeOff
from olympe.messages.ardrone3.PilotingState import FlyingStateChanged

drone = olympe.Drone(os.environ["DRONE_IP"])
assert drone.connect()
assert drone(TakeOff() >> FlyingStateChanged(state="hovering", _timeout=15)).wait().success()
print("flying", flush=True)
input()  # the drone was killed
start = time.monotonic()
while drone.connected and time.monotonic() - start < 30.0:
    time.sleep(0.05)
assert not drone.connected
noticed_s = time.monotonic() - start
drone.disconnect()
print("left", flush=True)
input()  # another one is there
again = olympe.Drone(os.environ["DRONE_IP"])
assert again.connect(retry=5)
assert again.get_state(FlyingStateChanged)["state"].name == "landed"
assert again.disconnect()
print(f"noticed after {noticed_s:.1f} s, connected to the next one")
