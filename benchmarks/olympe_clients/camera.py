# ruff: noqa: S101 - as a user of the SDK would write it
"""Take a photo and record a little, as far as the drone's answers go."""

import os

import olympe
from olympe.messages.camera import (
    photo_progress,
    recording_progress,
    set_camera_mode,
    start_recording,
    stop_recording,
    take_photo,
)

drone = olympe.Drone(os.environ.get("DRONE_IP", "127.0.0.1"))
assert drone.connect()
assert drone(set_camera_mode(cam_id=0, value="photo")).wait(_timeout=5).success()
photo = drone(
    take_photo(cam_id=0) >> photo_progress(result="photo_saved", _policy="wait", _timeout=5)
).wait()
assert photo.success(), photo.explain()
assert drone(set_camera_mode(cam_id=0, value="recording")).wait(_timeout=5).success()
assert drone(start_recording(cam_id=0)).wait(_timeout=5).success()
stopped = drone(
    stop_recording(cam_id=0) & recording_progress(result="stopped", _policy="wait", _timeout=5)
).wait()
assert stopped.success(), stopped.explain()
assert drone.disconnect()
