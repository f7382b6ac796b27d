# ruff: noqa: S101 - as a user of the SDK would write it
"""Connect and disconnect many times in a row, a new object each time.

A short while passes in between: Olympe crashes (a segmentation fault of its own) when it is
disconnected while its media client is still connecting.
"""

import os
import statistics
import time

import olympe
from olympe.messages.ardrone3.PilotingState import FlyingStateChanged

COUNT = int(os.environ.get("CONNECTIONS", "20"))
SETTLE_S = 0.5

olympe.log.update_config({"loggers": {"olympe": {"level": "ERROR"}}})
times_s = []
for index in range(COUNT):
    drone = olympe.Drone(os.environ.get("DRONE_IP", "127.0.0.1"))
    start = time.monotonic()
    assert drone.connect(), f"connection {index}"
    times_s.append(time.monotonic() - start)
    assert drone.get_state(FlyingStateChanged)["state"].name == "landed"
    time.sleep(SETTLE_S)
    assert drone.disconnect(), f"disconnection {index}"
print(
    f"{COUNT} connections: median {1e3 * statistics.median(times_s):.0f} ms, "
    f"longest {1e3 * max(times_s):.0f} ms"
)
