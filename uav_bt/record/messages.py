"""Foxglove's messages, made from ours; times are on the record's timeline."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from foxglove import messages as foxglove
from numpy.typing import NDArray

from uav_bt.record import Quality
from uav_bt.record.images import ENCODINGS, encode_image
from uav_bt.types import CameraModel

_CAMERA: Final = "camera"  # OpenCV's frame: x right, y down, z forward
_NS: Final = 1_000_000_000


def camera_image(image: NDArray[np.uint8], captured_ns: int, quality: Quality) -> bytes:
    """Return a frame's image, (H, W, 3) RGB, as a CompressedImage."""
    data, name = encode_image(image, quality)
    return foxglove.CompressedImage(
        timestamp=_stamp(captured_ns), frame_id=_CAMERA, data=data, format=name
    ).encode()


def raw(array: NDArray[Any], captured_ns: int) -> bytes:
    """Return an array, (H, W) of uint8, uint16 or float32, as a RawImage."""
    height, width = array.shape
    return foxglove.RawImage(
        timestamp=_stamp(captured_ns),
        frame_id=_CAMERA,
        width=width,
        height=height,
        encoding=ENCODINGS[array.dtype.name],
        step=width * array.itemsize,
        data=array.tobytes(),
    ).encode()


def calibration(camera: CameraModel, time_ns: int) -> bytes:
    """Return a camera as a CameraCalibration."""
    fx, fy, cx, cy = camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px
    return foxglove.CameraCalibration(
        timestamp=_stamp(time_ns),
        frame_id=_CAMERA,
        width=camera.width_px,
        height=camera.height_px,
        distortion_model="plumb_bob" if camera.distortion else "",
        D=list(camera.distortion),
        K=[fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0],
        R=[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        P=[fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0],
    ).encode()


def log_line(level: str, message: str, name: str, time_ns: int) -> bytes:
    """Return a line of a logger; `level` is "Info", "Warning" or "Error"."""
    return foxglove.Log(
        timestamp=_stamp(time_ns),
        level=getattr(foxglove.LogLevel, level),
        message=message,
        name=name,
    ).encode()


def _stamp(time_ns: int) -> foxglove.Timestamp:
    return foxglove.Timestamp(time_ns // _NS, time_ns % _NS)
