# ruff: noqa: S101 - as a user of the SDK would write it
"""Fly a square with turns; their end events must add up. Then interrupt a movement."""

import math
import os

import olympe
from olympe.messages.ardrone3.Piloting import Landing, TakeOff, moveBy
from olympe.messages.ardrone3.PilotingEvent import moveByEnd
from olympe.messages.ardrone3.PilotingState import FlyingStateChanged, moveByChanged

drone = olympe.Drone(os.environ.get("DRONE_IP", "127.0.0.1"))
assert drone.connect()
assert drone(TakeOff() >> FlyingStateChanged(state="hovering", _timeout=10)).wait().success()
for _ in range(4):
    side = drone(
        moveBy(1.0, 0.0, 0.0, math.pi / 2, _no_expect=True)
        >> FlyingStateChanged(state="flying", _timeout=5)
        >> moveByEnd(error="ok", _timeout=10)
        >> FlyingStateChanged(state="hovering", _timeout=5)
    ).wait()
    assert side.success(), side.explain()
    end = drone.get_last_event(moveByEnd).args
    assert math.isclose(end["dX"], 1.0, abs_tol=0.2), end
    assert math.isclose(end["dPsi"], math.pi / 2, abs_tol=0.2), end

# A second movement interrupts the first.
first = drone(moveBy(5.0, 0.0, 0.0, 0.0, _no_expect=True) >> moveByChanged(status="RUNNING"))
assert first.wait(_timeout=5).success()
second = drone(
    moveBy(0.0, 0.0, -0.5, 0.0, _no_expect=True)
    >> moveByEnd(error="interrupted", _timeout=5)
    >> moveByEnd(error="ok", _timeout=10)
).wait()
assert second.success(), second.explain()

# And a movement can be called off, by one of nothing: CancelMoveBy is for other drones.
called_off = drone(
    moveBy(5.0, 0.0, 0.0, 0.0, _no_expect=True)
    >> FlyingStateChanged(state="flying", _timeout=5)
    >> moveBy(0.0, 0.0, 0.0, 0.0, _no_expect=True)
    >> moveByEnd(error="interrupted", _timeout=5)
).wait()
assert called_off.success(), called_off.explain()
assert drone(Landing() >> FlyingStateChanged(state="landed", _timeout=10)).wait().success()

# On the ground there is no movement.
refused = drone(moveBy(1.0, 0.0, 0.0, 0.0, _no_expect=True) >> moveByEnd(error="notAvailable"))
assert refused.wait(_timeout=5).success()
assert drone.disconnect()
