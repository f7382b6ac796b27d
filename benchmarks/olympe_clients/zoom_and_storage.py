# ruff: noqa: S101 - as a user of the SDK would write it
"""Zoom in and out; watch the memory card, and format it."""

import os
import time

import olympe
from olympe.messages import camera, mediastore, user_storage

drone = olympe.Drone(os.environ.get("DRONE_IP", "127.0.0.1"))
assert drone.connect()

# By level, then by speed, then back: the level that the drone answers with counts.
assert drone(
    camera.set_zoom_target(cam_id=0, control_mode="level", target=2.0)
    & camera.zoom_level(cam_id=0, level=2.0, _policy="wait", _timeout=5)
).wait()
drone(camera.set_zoom_target(cam_id=0, control_mode="velocity", target=-0.5)).wait(_timeout=5)
time.sleep(1.5)
assert drone.get_state(camera.zoom_level)[0]["level"] == 1.0, drone.get_state(camera.zoom_level)
drone(camera.set_zoom_target(cam_id=0, control_mode="level", target=1.5)).wait(_timeout=5)
assert drone(
    camera.reset_zoom(cam_id=0) & camera.zoom_level(cam_id=0, level=1.0, _policy="wait", _timeout=5)
).wait()

# The card: its room once a second, a photograph that takes some of it, then all of it again.
assert drone(user_storage.start_monitoring(period=1)).wait(_timeout=5).success()
free = drone.get_state(user_storage.monitor)["available_bytes"]
taken = drone(
    camera.take_photo(cam_id=0)
    >> camera.photo_progress(result="photo_saved", _policy="wait", _timeout=5)
).wait()
assert taken.success(), taken.explain()
time.sleep(1.5)
assert drone.get_state(user_storage.monitor)["available_bytes"] < free
assert drone.get_state(mediastore.counters)["photo_media_count"] == 1
formatted = drone(
    user_storage.format(label="loopback")
    & user_storage.format_result(result="success", _policy="wait", _timeout=10)
).wait()
assert formatted.success(), formatted.explain()
assert drone.get_state(mediastore.counters)["photo_media_count"] == 0
assert drone.get_state(user_storage.info)["name"] == "loopback"
assert drone.disconnect()
print(f"{free / 2**20:.0f} MiB free")
