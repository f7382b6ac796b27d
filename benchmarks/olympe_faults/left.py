# ruff: noqa: S101 - as a user of the SDK would write it
"""Leave a drone, or be left by it: `left.py flies`, `left.py lands` or `left.py waits`."""

import os
import sys
import time

import olympe
from olympe.messages.ardrone3.Piloting import Landing, TakeOff
from olympe.messages.ardrone3.PilotingState import FlyingStateChanged

(what,) = sys.argv[1:]


def say(word: str) -> None:
    """Print a line in one piece: a thread of the SDK logs to the same output."""
    os.write(1, f"\n{word}\n".encode())


drone = olympe.Drone(os.environ["DRONE_IP"])
assert drone.connect(retry=5)
if what == "lands":  # a drone that somebody left in the air: it hovers
    assert drone(FlyingStateChanged(state="hovering", _timeout=5)).wait().success()
    assert drone(Landing() >> FlyingStateChanged(state="landed", _timeout=15)).wait().success()
    assert drone.disconnect()
    raise SystemExit
assert drone(TakeOff() >> FlyingStateChanged(state="hovering", _timeout=15)).wait().success()
if what == "flies":  # with the stick forward, until killed
    drone.start_piloting()
    drone.piloting(0, 10, 0, 0, 60.0)
    assert drone(FlyingStateChanged(state="flying", _timeout=5)).wait().success()
    say("flying")
    time.sleep(60.0)
say("flying")
input()  # the drone was killed
start = time.monotonic()
while drone.connected and time.monotonic() - start < 30.0:
    time.sleep(0.05)
assert not drone.connected
drone.disconnect()
say("left")
input()  # another one is there
again = olympe.Drone(os.environ["DRONE_IP"])
assert again.connect(retry=5)
assert again.get_state(FlyingStateChanged)["state"].name == "landed"
time.sleep(1.0)  # the SDK may crash if it disconnects as soon as it connected
assert again.disconnect()
