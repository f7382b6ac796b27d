# ruff: noqa: S101 - as a user of the SDK would write it
"""Give a hundred orders; each must be confirmed, with its own value."""

import os
import statistics
import time

import olympe
from olympe.messages.ardrone3.PilotingSettings import MaxTilt
from olympe.messages.ardrone3.PilotingSettingsState import MaxTiltChanged

drone = olympe.Drone(os.environ["DRONE_IP"])
assert drone.connect()
times_s = []
for number in range(100):
    wanted = 5.0 + number % 20
    start = time.monotonic()
    assert drone(MaxTilt(wanted)).wait(_timeout=10).success(), number
    times_s.append(time.monotonic() - start)
    assert drone.get_state(MaxTiltChanged)["current"] == wanted
assert drone.disconnect()
print(
    f"100 orders confirmed: median {1e3 * statistics.median(times_s):.0f} ms, "
    f"longest {1e3 * max(times_s):.0f} ms"
)
