"""Views of landing marks, drawn: tags, and masks of a mark on the ground."""

import math
from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from sim_bridge.anafi import anafi_camera
from tests.worlds import values
from uav_bt.landing_marks import MarkView
from uav_bt.plugins import make_mark_finder
from uav_bt.types import CameraModel, ClassMap, Frame, LandingMark, Pose2D
from uav_bt.types.arrays import Image
from uav_bt.types.projection import ground_points, project

GROUND_CAMERA = anafi_camera(320, 180)
CAMERA_M = 1.5
CELL_M = 0.01  # of the drawn ground
SIDE_PX = 800
AT_THE_SPOT = Pose2D(x_m=0.0, y_m=0.0, yaw_rad=0.0)


def texture(side_px: int = SIDE_PX) -> Image:
    """Return ground with spots of some centimetres, (side_px, side_px)."""
    noise = np.random.default_rng(1).normal(0.0, 1.0, (side_px, side_px))
    smooth = gaussian_filter(noise, 4.0, mode="wrap")
    return np.clip(120.0 + 25.0 * smooth / smooth.std(), 0.0, 255.0).astype(np.uint8)


def ground_view(
    ground: Image, body: Pose2D, *, off: tuple[float, float, float] = (0.0, 0.0, 0.0), at_s: float
) -> MarkView:
    """Return a noisy view straight down, at a pose of the body in the take-off frame.

    `ground` is (S, S) grey with the take-off spot in its middle; the drone's estimate is `off`.
    """
    pitch_rad = -math.pi / 2.0
    grid = np.stack(np.meshgrid(np.arange(320), np.arange(180)), axis=-1).reshape(-1, 2)
    places_m = ground_points(grid, GROUND_CAMERA, pitch_rad, CAMERA_M)
    places_m[:, 0] += GROUND_CAMERA.forward_offset_m
    cells = body.points_to_world(places_m) / CELL_M + (len(ground) - 1) / 2.0
    rows, columns = cells.T.astype(np.float32).reshape(2, 180, 320)
    seen = cv2.remap(ground, columns, rows, cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP)
    noise = np.random.default_rng(round(10.0 * at_s)).normal(0.0, 3.0, seen.shape)
    grey = np.clip(seen + noise, 0.0, 255.0).astype(np.uint8)
    image, index = np.repeat(grey[:, :, None], 3, axis=2), round(10.0 * at_s)
    frame = values.frame(image, pitch_rad, CAMERA_M, captured_s=at_s, index=index)
    believed = Pose2D(
        x_m=body.x_m + off[0], y_m=body.y_m + off[1], yaw_rad=body.yaw_rad + math.radians(off[2])
    )
    return MarkView(frame=frame, camera=GROUND_CAMERA, take_off=believed.pose_to_body(AT_THE_SPOT))


TAG_CAMERA = anafi_camera(640, 360)
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
    pixels = project(corners, TAG_CAMERA, math.radians(pitch_deg))
    width, height = picture.shape[1] - 0.5, picture.shape[0] - 0.5
    edges = np.array([(-0.5, -0.5), (width, -0.5), (width, height), (-0.5, height)], np.float32)
    finer = (pixels + 0.5) * _FINER - 0.5
    warp = cv2.getPerspectiveTransform(edges, finer.astype(np.float32))
    size = (TAG_CAMERA.width_px * _FINER, TAG_CAMERA.height_px * _FINER)
    large = cv2.warpPerspective(picture, warp, size, borderValue=(110, 120, 110))
    image = cv2.resize(
        large, (TAG_CAMERA.width_px, TAG_CAMERA.height_px), interpolation=cv2.INTER_AREA
    )
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
