# ruff: noqa: S101 - as a user of the SDK would write it
"""Connect to a drone that somebody left in the air: it hovers; land it."""

import os
import time

import olympe
from olympe.messages.ardrone3.Piloting import Landing
from olympe.messages.ardrone3.PilotingState import FlyingStateChanged

start = time.monotonic()
drone = olympe.Drone(os.environ["DRONE_IP"])
assert drone.connect(retry=5)
took_s = time.monotonic() - start
assert drone(FlyingStateChanged(state="hovering", _timeout=5)).wait().success()
hovers_s = time.monotonic() - start
assert drone(Landing() >> FlyingStateChanged(state="landed", _timeout=15)).wait().success()
assert drone.disconnect()
print(f"connected after {took_s:.1f} s, seen hovering after {hovers_s:.1f} s, landed")
