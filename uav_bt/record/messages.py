"""Foxglove's messages, made from ours."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from foxglove import messages as foxglove
from numpy.typing import NDArray

from uav_bt.record.channels import Quality
from uav_bt.record.images import encode_image, encoding_of
from uav_bt.types import Attitude, CameraModel, Pose

WORLD: Final = "world"  # z up, origin in the carpet's middle
BODY: Final = "drone"  # x forward, y left, z up: what viewers draw arrows and axes for
CAMERA_FRAME_ID: Final = "camera"  # OpenCV's: x right, y down, z forward

_Quaternion = tuple[float, float, float, float]  # x, y, z, w
_OPTICAL: Final[_Quaternion] = (-0.5, 0.5, -0.5, 0.5)  # from OpenCV's axes to forward, left, up
_NS: Final = 1_000_000_000


def _stamp(time_ns: int) -> foxglove.Timestamp:
    return foxglove.Timestamp(time_ns // _NS, time_ns % _NS)


def camera_image(image: NDArray[np.uint8], captured_ns: int, quality: Quality) -> bytes:
    """Return a frame's image as a CompressedImage.

    Args:
        image: (H, W, 3), RGB.
        captured_ns: when it was captured, on the record's timeline.
        quality: PNG or JPEG.
    """
    data, name = encode_image(image, quality)
    return foxglove.CompressedImage(
        timestamp=_stamp(captured_ns), frame_id=CAMERA_FRAME_ID, data=data, format=name
    ).encode()


def raw(array: NDArray[np.generic], captured_ns: int) -> bytes:
    """Return an array as a RawImage.

    Args:
        array: (H, W) of uint8, uint16 or float32.
        captured_ns: when its frame was captured, on the record's timeline.
    """
    encoding = encoding_of(array)
    height, width = array.shape
    return foxglove.RawImage(
        timestamp=_stamp(captured_ns),
        frame_id=CAMERA_FRAME_ID,
        width=width,
        height=height,
        encoding=encoding,
        step=width * array.itemsize,
        data=np.ascontiguousarray(array).tobytes(),
    ).encode()


def calibration(camera: CameraModel, time_ns: int) -> bytes:
    """Return a camera as a CameraCalibration."""
    fx, fy, cx, cy = camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px
    return foxglove.CameraCalibration(
        timestamp=_stamp(time_ns),
        frame_id=CAMERA_FRAME_ID,
        width=camera.width_px,
        height=camera.height_px,
        distortion_model="plumb_bob" if camera.distortion else "",
        D=list(camera.distortion),
        K=[fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0],
        R=[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        P=[fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0],
    ).encode()


def pose(where: Pose, attitude: Attitude, time_ns: int) -> bytes:
    """Return the drone's exact pose in the world as a PoseInFrame.

    Args:
        where: position and heading.
        attitude: roll and pitch; its yaw counts from the take-off and is not used.
        time_ns: on the record's timeline.
    """
    return foxglove.PoseInFrame(
        timestamp=_stamp(time_ns),
        frame_id=WORLD,
        pose=foxglove.Pose(
            position=foxglove.Vector3(x=where.x_m, y=where.y_m, z=where.z_m),
            orientation=_rotation(_body(where, attitude)),
        ),
    ).encode()


def transforms(
    where: Pose, attitude: Attitude, gimbal_pitch_rad: float, camera: CameraModel, time_ns: int
) -> tuple[bytes, bytes]:
    """Return where body and camera are in the world, as two FrameTransforms.

    Args:
        where: position and heading.
        attitude: roll and pitch.
        gimbal_pitch_rad: from the horizon; the camera is stabilised.
        camera: how far it sits ahead of the body's centre.
        time_ns: on the record's timeline.
    """
    body = _body(where, attitude)
    level = _product(_about(2, where.yaw_rad), _about(1, -gimbal_pitch_rad))
    ahead_m = _turned(body, (camera.forward_offset_m, 0.0, 0.0))
    return (
        _transform(BODY, (where.x_m, where.y_m, where.z_m), body, time_ns),
        _transform(
            CAMERA_FRAME_ID,
            (where.x_m + ahead_m[0], where.y_m + ahead_m[1], where.z_m + ahead_m[2]),
            _product(level, _OPTICAL),
            time_ns,
        ),
    )


def log_line(level: str, message: str, name: str, time_ns: int) -> bytes:
    """Return a line of the log.

    Args:
        level: "Info", "Warning" or "Error".
        message: the line.
        name: of the logger.
        time_ns: on the record's timeline.
    """
    return foxglove.Log(
        timestamp=_stamp(time_ns),
        level=getattr(foxglove.LogLevel, level),
        message=message,
        name=name,
    ).encode()


def _transform(
    child: str, at_m: tuple[float, float, float], turn: _Quaternion, time_ns: int
) -> bytes:
    return foxglove.FrameTransform(
        timestamp=_stamp(time_ns),
        parent_frame_id=WORLD,
        child_frame_id=child,
        translation=foxglove.Vector3(x=at_m[0], y=at_m[1], z=at_m[2]),
        rotation=_rotation(turn),
    ).encode()


def _rotation(turn: _Quaternion) -> foxglove.Quaternion:
    return foxglove.Quaternion(x=turn[0], y=turn[1], z=turn[2], w=turn[3])


def _body(where: Pose, attitude: Attitude) -> _Quaternion:
    # With y to the left and z up a nose that rises turns negatively about y.
    tilt = _product(_about(1, -attitude.pitch_rad), _about(0, attitude.roll_rad))
    return _product(_about(2, where.yaw_rad), tilt)


def _about(axis: int, angle_rad: float) -> _Quaternion:
    half = math.sin(angle_rad / 2.0)
    x, y, z = (half if index == axis else 0.0 for index in range(3))
    return x, y, z, math.cos(angle_rad / 2.0)


def _product(one: _Quaternion, other: _Quaternion) -> _Quaternion:
    """Return the turn that is first `other` and then `one`."""
    (ax, ay, az, aw), (bx, by, bz, bw) = one, other
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def _turned(turn: _Quaternion, vector: tuple[float, float, float]) -> tuple[float, float, float]:
    x, y, z, w = turn
    moved = _product(_product(turn, (*vector, 0.0)), (-x, -y, -z, w))
    return moved[:3]
