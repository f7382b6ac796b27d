"""Constants of the ANAFI, shared by the twin, the loopback drone and the real one."""

from __future__ import annotations

from typing import Final

from uav_bt.errors import ValueRangeError
from uav_bt.types import Airframe, CameraModel

ANAFI_AIRFRAME: Final = Airframe()  # its defaults describe the ANAFI
CAMERA_FORWARD_M = CameraModel.forward_offset_m  # from the body's centre forward to the lens
FOCAL_SHARE = 0.7275  # focal length / image width: the video's field of view is 69 degrees wide


def anafi_camera(width_px: int, height_px: int) -> CameraModel:
    """Return the intrinsics of the video at an image size.

    Args:
        width_px: image width, pixels.
        height_px: image height, pixels; the aspect must be 16:9 (to the nearest pixel).

    Raises:
        ValueRangeError: the aspect is not 16:9, or the size is not positive.
    """
    if width_px < 16 or abs(height_px - width_px * 9 / 16) > 1.0:
        raise ValueRangeError(
            "the ANAFI's video is 16:9 (640x360, 320x180, 1152x648, ...), "
            f"got {width_px}x{height_px}"
        )
    focal = FOCAL_SHARE * width_px
    return CameraModel(
        width_px=width_px,
        height_px=height_px,
        fx_px=focal,
        fy_px=focal,
        cx_px=(width_px - 1) / 2,
        cy_px=(height_px - 1) / 2,
        forward_offset_m=CAMERA_FORWARD_M,
    )
