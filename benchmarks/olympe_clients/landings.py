# ruff: noqa: S101 - as a user of the SDK would write it
"""Take off and land; cut the motors out in the air: the drone falls, and can take off again."""

import os

import olympe
from olympe.messages.ardrone3.Piloting import Emergency, Landing, TakeOff
from olympe.messages.ardrone3.PilotingState import FlyingStateChanged

drone = olympe.Drone(os.environ.get("DRONE_IP", "127.0.0.1"))
assert drone.connect()
assert drone(TakeOff() >> FlyingStateChanged(state="hovering", _timeout=10)).wait().success()
assert drone(Landing() >> FlyingStateChanged(state="landed", _timeout=10)).wait().success()
assert drone(TakeOff() >> FlyingStateChanged(state="hovering", _timeout=10)).wait().success()
fallen = drone(Emergency() >> FlyingStateChanged(state="landed", _timeout=10)).wait()
assert fallen.success(), fallen.explain()
assert drone(TakeOff() >> FlyingStateChanged(state="hovering", _timeout=10)).wait().success()
assert drone(Landing() >> FlyingStateChanged(state="landed", _timeout=10)).wait().success()
assert drone.disconnect()
