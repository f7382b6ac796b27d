# ruff: noqa: S101, ANN201 - as a user of the SDK would write it
"""Through a SkyController: take the sticks, fly, give them to the pilot and take them back."""

import os
import time

import olympe
from olympe.messages import drone_manager, mapper, skyctrl
from olympe.messages.ardrone3.Piloting import Landing, TakeOff
from olympe.messages.ardrone3.PilotingState import FlyingStateChanged, SpeedChanged
from olympe.messages.skyctrl.CoPiloting import setPilotingSource
from olympe.messages.skyctrl.CoPilotingState import pilotingSource

GRABBED = 0b111  # some buttons that the program wants for itself

remote = olympe.SkyController3(os.environ.get("DRONE_IP", "127.0.0.1"))
assert remote.connect()
behind = drone_manager.connection_state(state="connected", _policy="check_wait", _timeout=5)
assert remote(behind).wait().success()
assert remote.get_state(skyctrl.SkyControllerState.BatteryChanged)["percent"] > 0
assert remote.get_state(pilotingSource)["source"].name == "SkyController"


def speed_mps():
    """Return how fast the drone flies north."""
    return remote.get_state(SpeedChanged)["speedX"]


def steer():
    """Push the stick forward for a second."""
    for _ in range(10):
        remote.piloting(0, 50, 0, 0, 0.2)
        time.sleep(0.1)
    return speed_mps()


def offboard():
    """Take the sticks."""
    assert remote(mapper.grab(GRABBED, 0)).wait(_timeout=5)
    assert remote(setPilotingSource(source="Controller")).wait(_timeout=5).success()


def manual():
    """Let the pilot fly."""
    assert remote(mapper.grab(0, 0)).wait(_timeout=5)
    assert remote(setPilotingSource(source="SkyController")).wait(_timeout=5).success()


offboard()
assert remote(TakeOff() >> FlyingStateChanged(state="hovering", _timeout=10)).wait().success()
ours = steer()
assert abs(ours) > 0.3, ours
manual()
time.sleep(3.0)
theirs = steer()
assert abs(theirs) < 0.15, theirs  # the pilot has the sticks, and does not touch them
offboard()
again = steer()
assert abs(again) > 0.3, again
remote.stop_piloting()
assert remote(Landing() >> FlyingStateChanged(state="landed", _timeout=15)).wait().success()
assert remote.disconnect()
print(f"{abs(ours):.1f} m/s with the sticks, {abs(theirs):.1f} m/s without, {abs(again):.1f} m/s")
