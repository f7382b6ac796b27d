# ruff: noqa: S101, ANN001, ANN201 - as a user of the SDK would write it
"""Watch the video for some seconds and count its frames; each carries its metadata."""

import os
import time

import olympe

PORT = os.environ.get("DRONE_RTSP_PORT")
NEW_API = int(olympe.__version__.split(".")[0]) >= 8

seen = []


def on_frame(frame):
    """Note a frame's size and whether it has the place of the drone."""
    frame.ref()
    try:
        info = frame.info()["raw"]["frame"]["info"]
        seen.append((info["width"], info["height"], frame.vmeta()[1] is not None))
    finally:
        frame.unref()


drone = olympe.Drone(os.environ.get("DRONE_IP", "127.0.0.1"))
assert drone.connect()
if PORT:
    drone.streaming.server_addr = f"{os.environ.get('DRONE_IP', '127.0.0.1')}:{PORT}"
if NEW_API:
    assert drone.streaming.play(raw_cb=on_frame)
else:
    drone.streaming.set_callbacks(raw_cb=on_frame)
    assert drone.streaming.play()
time.sleep(5.0)
assert drone.streaming.stop()
assert drone.disconnect()
assert len(seen) > 25, len(seen)
assert all(metadata for _, _, metadata in seen), seen[:3]
print(f"{len(seen)} frames of {seen[0][0]}x{seen[0][1]}")
