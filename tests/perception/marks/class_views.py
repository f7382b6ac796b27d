"""Views of class maps, for finders that use no image."""

from __future__ import annotations

import math

from tests.worlds import values
from uav_bt.landing_marks import MarkView
from uav_bt.types import CameraModel, ClassMap


def view_of_classes(
    class_map: ClassMap | None, camera: CameraModel, *, pitch_deg: float, height_m: float
) -> MarkView:
    """Return a class map as the view of a camera at a pitch and a height above the ground."""
    frame = values.frame((4, 8), math.radians(pitch_deg), height_m)
    return MarkView(frame=frame, camera=camera, class_map=class_map)
