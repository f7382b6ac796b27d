"""Foxglove's messages, made from ours. `time_ns` and `captured_ns` are on the record's timeline."""

from __future__ import annotations

from typing import Final

import numpy as np
from foxglove import messages as foxglove
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from uav_bt.record.config import Quality
from uav_bt.record.images import encode_image, encoding_of
from uav_bt.types import Attitude, CameraModel, Pose

WORLD: Final = "world"  # z up, origin in the ground's middle
BODY: Final = "drone"  # x forward, y left, z up: the convention of viewers
CAMERA_FRAME_ID: Final = "camera"  # OpenCV's: x right, y down, z forward

_OPTICAL: Final = (-0.5, 0.5, -0.5, 0.5)  # from OpenCV's axes to forward, left, up
LEVEL: Final = Attitude()
_NS: Final = 1_000_000_000


def stamp(time_ns: int) -> foxglove.Timestamp:
    """Return a time of the record as Foxglove has it."""
    return foxglove.Timestamp(time_ns // _NS, time_ns % _NS)


def camera_image(image: NDArray[np.uint8], captured_ns: int, quality: Quality) -> bytes:
    """Return a frame's image, (H, W, 3) RGB, as a CompressedImage."""
    data, name = encode_image(image, quality)
    return foxglove.CompressedImage(
        timestamp=stamp(captured_ns), frame_id=CAMERA_FRAME_ID, data=data, format=name
    ).encode()


def raw(array: NDArray[np.generic], captured_ns: int) -> bytes:
    """Return an array, (H, W) of uint8, uint16 or float32, as a RawImage."""
    height, width = array.shape
    return foxglove.RawImage(
        timestamp=stamp(captured_ns),
        frame_id=CAMERA_FRAME_ID,
        width=width,
        height=height,
        encoding=encoding_of(array),
        step=width * array.itemsize,
        data=np.ascontiguousarray(array).tobytes(),
    ).encode()


def calibration(camera: CameraModel, time_ns: int) -> bytes:
    """Return a camera as a CameraCalibration."""
    fx, fy, cx, cy = camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px
    return foxglove.CameraCalibration(
        timestamp=stamp(time_ns),
        frame_id=CAMERA_FRAME_ID,
        width=camera.width_px,
        height=camera.height_px,
        distortion_model="plumb_bob" if camera.distortion else "",
        D=list(camera.distortion),
        K=[fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0],
        R=[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        P=[fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0],
    ).encode()


def placed(where: Pose, attitude: Attitude = LEVEL) -> foxglove.Pose:
    """Return a pose in the world; the attitude's yaw counts from the take-off and is not used."""
    return foxglove.Pose(
        position=foxglove.Vector3(x=where.x_m, y=where.y_m, z=where.z_m),
        orientation=_quaternion(_body(where, attitude)),
    )


def pose(where: Pose, attitude: Attitude, time_ns: int) -> bytes:
    """Return the drone's exact pose in the world as a PoseInFrame; the attitude's yaw is unused."""
    return foxglove.PoseInFrame(
        timestamp=stamp(time_ns),
        frame_id=WORLD,
        pose=placed(where, attitude),
    ).encode()


def transforms(
    where: Pose, attitude: Attitude, gimbal_pitch_rad: float, camera: CameraModel, time_ns: int
) -> tuple[bytes, bytes]:
    """Return the poses of body and stabilised camera in the world, as two FrameTransforms."""
    body = _body(where, attitude)
    at_m = np.array([where.x_m, where.y_m, where.z_m])
    lens_m = at_m + body.apply([camera.forward_offset_m, 0.0, 0.0])
    return (
        _transform(BODY, at_m, body, time_ns),
        _transform(CAMERA_FRAME_ID, lens_m, _lens(where, gimbal_pitch_rad), time_ns),
    )


def log_line(level: str, message: str, name: str, time_ns: int) -> bytes:
    """Return a line of a logger; `level` is "Info", "Warning" or "Error"."""
    return foxglove.Log(
        timestamp=stamp(time_ns),
        level=getattr(foxglove.LogLevel, level),
        message=message,
        name=name,
    ).encode()


def _transform(child: str, at_m: NDArray[np.float64], turn: Rotation, time_ns: int) -> bytes:
    return foxglove.FrameTransform(
        timestamp=stamp(time_ns),
        parent_frame_id=WORLD,
        child_frame_id=child,
        translation=foxglove.Vector3(x=float(at_m[0]), y=float(at_m[1]), z=float(at_m[2])),
        rotation=_quaternion(turn),
    ).encode()


def _quaternion(turn: Rotation) -> foxglove.Quaternion:
    x, y, z, w = turn.as_quat()
    return foxglove.Quaternion(x=x, y=y, z=z, w=w)


def _body(where: Pose, attitude: Attitude) -> Rotation:
    # With y to the left and z up, raising the nose is a negative turn about y.
    return Rotation.from_euler("ZYX", [where.yaw_rad, -attitude.pitch_rad, attitude.roll_rad])


def _lens(where: Pose, gimbal_pitch_rad: float) -> Rotation:
    level = Rotation.from_euler("ZY", [where.yaw_rad, -gimbal_pitch_rad])
    return level * Rotation.from_quat(_OPTICAL)
