"""Views of class maps, for finders that use no image."""

from __future__ import annotations

import math

import numpy as np

from uav_bt.landing_marks import MarkView
from uav_bt.types import CameraModel, ClassMap, Frame


def view_of_classes(
    class_map: ClassMap | None, camera: CameraModel, *, pitch_deg: float, height_m: float
) -> MarkView:
    """Return a class map as the view of a camera at a pitch and a height above the ground."""
    frame = Frame(
        image=np.zeros((4, 8, 3), np.uint8),
        index=0,
        captured_s=0.0,
        gimbal_pitch_rad=math.radians(pitch_deg),
        height_above_ground_m=height_m,
    )
    return MarkView(frame=frame, camera=camera, class_map=class_map)
