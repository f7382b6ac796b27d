"""Landing marks of printed tags: AprilTag and ArUco, one tag or a board, with OpenCV's detector."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import ClassVar, Final

import cv2
import numpy as np

from perception.marks.tag_board import APRILTAG_FAMILIES, ARUCO_FAMILIES, draw_board, read_board
from perception.marks.tag_edges import refine_corners
from perception.marks.tag_pose import BoardPose, level_pose
from uav_bt.landing_marks import MarkSighting, MarkView
from uav_bt.types import LandingMark
from uav_bt.types.arrays import Floats, Image

_SURE_PX: Final = 16.0  # least edge of a tag of full confidence: 2 pixels a cell of 36h11. Chosen.
# Error of the corners above which the pose is a false match: pixels, and share of the edge. Chosen.
_WORST_PX: Final = 2.0
_WORST_SHARE: Final = 0.05
# The measured height of the mark may differ from the lab's by this, and by this share of the range.
# A larger difference lowers the confidence: the tag has another size than the lab file states.
_HEIGHT_M: Final = 0.15
_HEIGHT_SHARE: Final = 0.15
_PICTURE_PX_PER_M: Final = 1024.0


class TagFinder:
    """Base of the finders of tags; implements `MarkFinder`. Its options are those of `TagOptions`.

    The pose comes from the size of the tags, so that it needs neither a class map nor the height of
    the camera.
    """

    uses_images = True
    shows_heading = True
    families: ClassVar[Mapping[str, int]]

    def __init__(self, mark: LandingMark) -> None:
        self._mark = mark
        self._board = read_board(mark, self.families)
        self._corners_m = [tag.corners_m() for tag in self._board.tags]
        self._detector = cv2.aruco.ArucoDetector(self._board.dictionary)

    def find(self, view: MarkView) -> MarkSighting | None:
        """Return the mark in an image; None if it shows none of the tags."""
        frame = view.frame
        if not math.isfinite(frame.gimbal_pitch_rad):
            return None
        corners_px = self._detect(frame.image)
        if not corners_px:
            return None
        height_px, width_px = frame.image.shape[:2]
        camera = view.camera.resized(width_px, height_px)
        pose = level_pose(
            np.concatenate([self._corners_m[each] for each in corners_px]),
            np.concatenate(list(corners_px.values())),
            camera,
            frame.gimbal_pitch_rad,
        )
        edge_px = max(_least_edge_px(corners) for corners in corners_px.values())
        if pose is None or pose.error_px > max(_WORST_PX, _WORST_SHARE * edge_px):
            return None
        return MarkSighting(
            forward_m=pose.forward_m + camera.forward_offset_m,
            right_m=pose.right_m,
            height_m=self._mark.height_m,
            confidence=min(1.0, edge_px / _SURE_PX) * self._agreement(pose, view),
            heading_deg=-math.degrees(pose.up_rad),
        )

    def picture(self) -> Image:
        """Return the white top with its tags, (H, W, 3) RGB."""
        return draw_board(self._board, self._mark, _PICTURE_PX_PER_M)

    def _detect(self, image: Image) -> dict[int, Floats]:
        """Return the corners of the tags in an image, (4, 2) each, by their place on the list."""
        grey = np.asarray(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), dtype=np.uint8)
        corners, ids, _ = self._detector.detectMarkers(grey)
        found: dict[int, Floats] = {}
        for number, square in zip([] if ids is None else ids.ravel(), corners, strict=True):
            if int(number) not in found:
                rough = np.asarray(square, dtype=np.float64).reshape(4, 2)
                found[int(number)] = refine_corners(grey, rough)
        return found

    def _agreement(self, pose: BoardPose, view: MarkView) -> float:
        """Return how well the measured height of the mark agrees with the lab's, 0 to 1."""
        camera_m = view.frame.height_above_ground_m
        if not math.isfinite(camera_m):
            return 1.0
        off_m = abs(camera_m - pose.down_m - self._mark.height_m)
        range_m = math.hypot(pose.forward_m, pose.right_m, pose.down_m)
        return min(1.0, (_HEIGHT_M + _HEIGHT_SHARE * range_m) / max(off_m, 1e-9))


def _least_edge_px(corners_px: Floats) -> float:
    """Return the shortest side of a tag in the image, pixels; corners (4, 2)."""
    return float(np.linalg.norm(corners_px - np.roll(corners_px, 1, axis=0), axis=1).min())


class AprilTagFinder(TagFinder):
    """Finds AprilTags; implements `MarkFinder`. Its upper edge is as OpenCV draws the tags."""

    families = APRILTAG_FAMILIES


class ArucoFinder(TagFinder):
    """Finds ArUco markers; implements `MarkFinder`."""

    families = ARUCO_FAMILIES
