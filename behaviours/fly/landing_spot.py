"""Search for a landing spot in the class map of a view straight down.

A spot is a disc that lies entirely on one surface: the ground, or the top of the landing box. The
two are at different heights, so each is measured in the plane of its surface. Pixels outside the
image are unknown and count as occupied.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uav_bt.lab.classes import GROUND, MARK
from uav_bt.types import MIN_VIEW_HEIGHT_M, CameraModel, ClassMap, Frame
from uav_bt.types.projection import ground_points, project


@dataclass(frozen=True)
class LandingSpot:
    """A free place to land, relative to the body's centre.

    Attributes:
        forward_m: Distance ahead.
        right_m: Distance to the right.
    """

    forward_m: float
    right_m: float

    @property
    def range_m(self) -> float:
        """Horizontal distance from the body's centre, metres."""
        return math.hypot(self.forward_m, self.right_m)


def nearest_landing_spot(
    class_map: ClassMap, camera: CameraModel, frame: Frame, *, radius_m: float, mark_m: float
) -> LandingSpot | None:
    """Return the nearest disc that lies entirely on one surface; None without one in view.

    Args:
        class_map: (H, W) class map of a frame that looks straight down.
        camera: Intrinsics at the class map's size.
        frame: The frame that the class map was made from.
        radius_m: Radius of the disc.
        mark_m: Height of the landing mark's top above the ground.
    """
    roles = class_map.roles
    height_m = max(frame.height_above_ground_m, MIN_VIEW_HEIGHT_M)
    surfaces = [(roles == GROUND, height_m)]
    above_pad_m = height_m - mark_m
    if above_pad_m >= MIN_VIEW_HEIGHT_M:
        top = _pad_top(roles == MARK, camera, frame, above_pad_m / height_m)
        surfaces.append((top, above_pad_m))
    found = [
        spot
        for surface, below_m in surfaces
        if (spot := _nearest(surface, camera, frame, below_m, radius_m)) is not None
    ]
    return min(found, key=lambda spot: spot.range_m, default=None)


def _pad_top(
    pad: NDArray[np.bool_], camera: CameraModel, frame: Frame, scale: float
) -> NDArray[np.bool_]:
    """Return the pixels that show the top of the landing box, without its visible sides.

    A point at the foot of the box appears nearer to the point straight below the camera than the
    same point of the top, by the ratio of the camera's heights above top and ground. A pixel that
    this ratio maps outside the box shows a side.

    Args:
        pad: (H, W), True where the landing box is seen.
        camera: Intrinsics at that size.
        frame: Source of the camera's pitch.
        scale: Height of the camera above the top over its height above the ground.
    """
    import cv2  # noqa: PLC0415 - `uav-bt check` imports this module and must answer at once

    column, row = project((0.0, 0.0, 1.0), camera, frame.gimbal_pitch_rad)
    to_foot = np.array([[scale, 0.0, (1.0 - scale) * column], [0.0, scale, (1.0 - scale) * row]])
    foot = cv2.warpAffine(
        pad.astype(np.uint8),
        to_foot,
        pad.shape[::-1],
        flags=cv2.INTER_NEAREST | cv2.WARP_INVERSE_MAP,
    )
    return np.asarray(pad & foot.astype(bool))


def _nearest(
    surface: NDArray[np.bool_], camera: CameraModel, frame: Frame, height_m: float, radius_m: float
) -> LandingSpot | None:
    """Return the nearest disc within a level surface.

    Args:
        surface: (H, W), True where the surface is seen.
        camera: Intrinsics at that size.
        frame: Source of the camera's pitch.
        height_m: Height of the camera above the surface.
        radius_m: Radius of the disc.
    """
    import cv2  # noqa: PLC0415 - see above

    clear_px = cv2.distanceTransform(np.pad(surface.astype(np.uint8), 1), cv2.DIST_L2, 5)
    px_per_m = max(camera.fx_px, camera.fy_px) / height_m
    # The distance counts to the middle of the next pixel; the surface ends half a pixel earlier.
    rows, columns = np.nonzero(clear_px[1:-1, 1:-1] - 0.5 >= radius_m * px_per_m)
    if rows.size == 0:
        return None
    pixels = np.stack([columns, rows], axis=-1)
    spots = ground_points(pixels, camera, frame.gimbal_pitch_rad, height_m)
    spots[:, 0] += camera.forward_offset_m
    forward_m, right_m = spots[np.argmin(np.hypot(spots[:, 0], spots[:, 1]))]
    return LandingSpot(float(forward_m), float(right_m))
