"""Views of a level picture at a known place, warped without a renderer, and of class maps."""

import math
from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from sim_bridge.anafi import anafi_camera
from tests.worlds import values
from uav_bt.landing_marks import MarkView
from uav_bt.plugins import make_mark_finder
from uav_bt.types import CameraModel, ClassMap, Frame, LandingMark
from uav_bt.types.projection import project

CAMERA = anafi_camera(640, 360)
_PX_PER_M = 400.0  # of a drawn floor
_FINER = 3  # the view is warped larger and shrunk, which smooths it as a lens does


def tag_mark(*, kind: str = "apriltag", height_m: float = 0.2, options: Any = None) -> LandingMark:
    """Return a mark of half a metre with tag 7 of 0.36 m."""
    tag = {"id": 7, "size_m": 0.36} if options is None else options
    return LandingMark(kind=kind, length_m=0.5, width_m=0.5, height_m=height_m, options=tag)


def view_of(
    picture: NDArray[np.uint8],
    mark: LandingMark,
    *,
    forward_m: float,
    right_m: float = 0.0,
    heading_deg: float = 0.0,
    pitch_deg: float = -45.0,
    camera_m: float = 1.5,
) -> Frame:
    """Return a frame that shows a mark's picture, its upper edge first.

    Its middle is ahead of the lens and to the right. The heading is that of the camera relative to
    the mark, clockwise; the lens is `camera_m` above the ground.
    """
    up_rad = math.radians(-heading_deg)
    up = np.array([math.cos(up_rad), math.sin(up_rad), 0.0]) * mark.width_m / 2.0
    right = np.array([-math.sin(up_rad), math.cos(up_rad), 0.0]) * mark.length_m / 2.0
    middle = np.array([forward_m, right_m, camera_m - mark.height_m])
    aside, ahead = np.array([-1, 1, 1, -1])[:, None], np.array([1, 1, -1, -1])[:, None]
    corners = middle + aside * right + ahead * up
    pixels = project(corners, CAMERA, math.radians(pitch_deg))
    width, height = picture.shape[1] - 0.5, picture.shape[0] - 0.5
    edges = np.array([(-0.5, -0.5), (width, -0.5), (width, height), (-0.5, height)], np.float32)
    finer = (pixels + 0.5) * _FINER - 0.5
    warp = cv2.getPerspectiveTransform(edges, finer.astype(np.float32))
    size = (CAMERA.width_px * _FINER, CAMERA.height_px * _FINER)
    large = cv2.warpPerspective(picture, warp, size, borderValue=(110, 120, 110))
    image = cv2.resize(large, (CAMERA.width_px, CAMERA.height_px), interpolation=cv2.INTER_AREA)
    return values.frame(np.asarray(image, dtype=np.uint8), math.radians(pitch_deg), camera_m)


def floor_view(prints: Sequence[tuple[LandingMark, float, float]]) -> Frame:
    """Return a view straight down from 1.5 m at prints, each with its place right and ahead, m."""
    floor = LandingMark(length_m=2.4, width_m=1.4, height_m=0.0)
    picture = np.full((round(1.4 * _PX_PER_M), round(2.4 * _PX_PER_M), 3), 120, np.uint8)
    for mark, right_m, ahead_m in prints:
        top = make_mark_finder(mark).picture()
        assert top is not None
        side_px = round(mark.length_m * _PX_PER_M)
        left = round((1.2 + right_m) * _PX_PER_M - side_px / 2.0)
        upper = round((0.7 - ahead_m) * _PX_PER_M - side_px / 2.0)
        paper = cv2.resize(top, (side_px, side_px), interpolation=cv2.INTER_AREA)
        picture[upper : upper + side_px, left : left + side_px] = paper
    return view_of(picture, floor, forward_m=0.0, pitch_deg=-90.0)


def view_of_classes(
    class_map: ClassMap | None, camera: CameraModel, *, pitch_deg: float, height_m: float
) -> MarkView:
    """Return a class map as the view of a camera at a pitch and a height above the ground."""
    frame = values.frame((4, 8), math.radians(pitch_deg), height_m)
    return MarkView(frame=frame, camera=camera, class_map=class_map)
