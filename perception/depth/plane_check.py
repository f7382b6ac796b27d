"""Does a network's depth of the ground agree with the plane that camera, pitch and height give?

A network whose depth is in heights of the camera gives the depth of the ground without a camera
file. Where the focal length of the file is wrong, the plane is seen at other angles, and the ratio
of the two depths changes with the range: by the power of one minus the factor. A wrong pitch
changes ratio and power. A network in a place unlike its training contradicts the plane, too. A
wrong height does not show here: it changes the plane alone, and so the unit of the network.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from perception.camera.ground_plane import GroundPlane, view_of
from perception.depth.confidence import Measure, evidence, weakest
from perception.depth.scale import resized, sample_ground
from uav_bt.types import CameraModel, ClassMap, DepthMap, Frame

_EXTENT: Final = 0.9  # least extent of the ground in view
# Steeper views are not judged. Their ranges differ little, so a small error of the depth looks
# like a slope, and the shipped network was not trained on them.
_STEEPEST_RAD: Final = math.radians(-60.0)


def agreement_with_plane(
    relative: DepthMap,
    class_map: ClassMap,
    frame: Frame,
    camera: CameraModel,
    generator: np.random.Generator,
) -> Measure | None:
    """Return how far depth in heights agrees with the plane of the ground: the weakest measure.

    None where too little ground is in view, for a camera that looks down steeply, and for depth of
    another unit or of another frame.
    """
    if frame.gimbal_pitch_rad < _STEEPEST_RAD:
        return None
    of_frame = relative.captured_s == class_map.captured_s == frame.captured_s
    if not (relative.in_heights and of_frame and frame.height_above_ground_m > 0.0):
        return None
    height_px, width_px = class_map.ids.shape
    plane = GroundPlane.of(view_of(frame, camera, (width_px, height_px)))
    depth = resized(relative.depth, class_map.ids.shape)
    sample = sample_ground(depth, class_map.is_ground, plane.depth_m, generator)
    if sample is None:
        return None
    found = evidence(sample.measures, None, plane.view.height_m)
    if found["extent"][0] < _EXTENT:
        return None
    return weakest({name: found[name] for name in ("slope", "height")})
