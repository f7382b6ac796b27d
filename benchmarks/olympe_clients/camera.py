# ruff: noqa: S101 - as a user of the SDK would write it
"""Change the camera's mode, and take a photograph."""

import os

import olympe
from olympe.messages.camera import photo_progress, set_camera_mode, take_photo

drone = olympe.Drone(os.environ.get("DRONE_IP", "127.0.0.1"))
assert drone.connect()
assert drone(set_camera_mode(cam_id=0, value="photo")).wait(_timeout=5).success()
photo = drone(
    take_photo(cam_id=0) >> photo_progress(result="photo_saved", _policy="wait", _timeout=5)
).wait()
assert photo.success(), photo.explain()
assert drone(set_camera_mode(cam_id=0, value="recording")).wait(_timeout=5).success()
assert drone.disconnect()
