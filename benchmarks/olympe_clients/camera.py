# ruff: noqa: S101, ANN001, ANN201 - as a user of the SDK would write it
"""Look down and up; the bounds hold. Then change the camera's mode, and take a photograph."""

import os

import olympe
from olympe.messages import gimbal
from olympe.messages.camera import photo_progress, set_camera_mode, take_photo

drone = olympe.Drone(os.environ.get("DRONE_IP", "127.0.0.1"))
assert drone.connect()


def target(pitch):
    """Return the command that points the camera."""
    return gimbal.set_target(
        gimbal_id=0,
        control_mode="position",
        yaw_frame_of_reference="none",
        yaw=0.0,
        pitch_frame_of_reference="absolute",
        pitch=pitch,
        roll_frame_of_reference="none",
        roll=0.0,
    )


def looks(pitch):
    """Return the expectation of an attitude."""
    return gimbal.attitude(gimbal_id=0, pitch_absolute=pitch, _float_tol=(0.01, 0.5), _timeout=5)


for pitch in (-90.0, -45.0, 0.0, 30.0):
    reached = drone(target(pitch) >> looks(pitch)).wait()
    assert reached.success(), reached.explain()
assert drone(gimbal.reset_orientation(gimbal_id=0) >> looks(0.0)).wait().success()
assert drone(gimbal.set_max_speed(gimbal_id=0, yaw=0.0, pitch=180.0, roll=0.0)).wait().success()
assert drone(target(-120.0) >> looks(-90.0)).wait().success()
bounds = drone.get_state(gimbal.absolute_attitude_bounds)
bounds = bounds.get(0, bounds)
assert bounds["min_pitch"] <= -90.0

assert drone(set_camera_mode(cam_id=0, value="photo")).wait(_timeout=5).success()
photo = drone(
    take_photo(cam_id=0) >> photo_progress(result="photo_saved", _policy="wait", _timeout=5)
).wait()
assert photo.success(), photo.explain()
assert drone(set_camera_mode(cam_id=0, value="recording")).wait(_timeout=5).success()
assert drone.disconnect()
