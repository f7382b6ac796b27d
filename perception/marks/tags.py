"""Landing marks of printed tags: AprilTag and ArUco, one tag or a board, with OpenCV's detector."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import ClassVar, Final, NamedTuple

import cv2
import numpy as np

from perception.marks import tag_board
from perception.marks.tag_pose import BoardPose, level_pose, placed_corners, refine_corners
from uav_bt.landing_marks import MarkSighting, MarkView
from uav_bt.types import LandingMark
from uav_bt.types.arrays import Floats, Image
from uav_bt.types.projection import project

_SURE_PX: Final = 16.0  # least edge of a tag of full confidence: 2 pixels a cell of 36h11. Chosen.
# Error of the corners above which the pose is a false match: pixels, and share of the edge. Chosen.
_WORST_PX: Final = 2.0
_WORST_SHARE: Final = 0.05
# By the pose of one tag alone another tag of the board is expected within this share of its edge.
# Chosen: the pose is noisier than the tag.
_NEAR_SHARE: Final = 0.25
# The measured height of the mark may differ from the lab's by this, and by this share of the range.
# A larger difference lowers the confidence: the tag has another size than the lab file states.
_HEIGHT_M: Final = 0.15
_HEIGHT_SHARE: Final = 0.15
_PICTURE_PX_PER_M: Final = 1024.0


class _Seen(NamedTuple):
    """A tag in the image."""

    place: int  # on the list of the mark's tags
    corners_px: Floats  # (4, 2)
    edge_px: float  # its shortest side


class _Fit(NamedTuple):
    """A pose of the mark by some of the tags in view."""

    pose: BoardPose
    edge_px: float
    agreement: float  # of the measured height of the mark with the lab's, 0 to 1
    weight: float  # number of tags, times that agreement


class TagFinder:
    """Base of the finders of tags; implements `MarkFinder`. Its options are a `TagOptions`.

    The pose comes from the size of the tags, so that it needs neither a class map nor the height of
    the camera.
    """

    uses_images = True
    shows_heading = True
    families: ClassVar[Mapping[str, int]]
    options: ClassVar[type[tag_board.TagOptions]] = tag_board.TagOptions

    def __init__(self, mark: LandingMark) -> None:
        self._mark = mark
        self.board: Final = tag_board.read_board(mark, self.families, self.options)
        self._corners_m = [tag.corners_m() for tag in self.board.tags]
        self._detector = cv2.aruco.ArucoDetector(self.board.dictionary)

    def find(self, view: MarkView) -> MarkSighting | None:
        """Return the mark in an image; None if it shows none of the tags, or two such marks."""
        if not math.isfinite(view.frame.gimbal_pitch_rad):
            return None
        view = replace(view, camera=view.camera.resized(*view.frame.image.shape[1::-1]))
        seen = self._detect(view.frame.image)
        once = 0 < len(seen) == len({tag.place for tag in seen})
        whole = self._fit(seen, view) if once else None
        fits = [whole] if whole else [self._around(tag, seen, view) for tag in seen]
        best = max(filter(None, fits), key=lambda fit: fit.weight, default=None)
        if best is None:
            return None
        # A pose counts fully if it has twice the weight of one at another place.
        apart_m = max(tag.size_m for tag in self.board.tags) / 2.0
        others = [fit for fit in fits if fit and math.dist(fit.pose[:2], best.pose[:2]) > apart_m]
        rival = max((fit.weight for fit in others), default=0.0)
        clear = min(1.0, 2.0 * (1.0 - rival / best.weight))
        if clear <= 0.0:
            return None
        return MarkSighting(
            forward_m=best.pose.forward_m + view.camera.forward_offset_m,
            right_m=best.pose.right_m,
            height_m=self._mark.height_m,
            confidence=min(1.0, best.edge_px / _SURE_PX) * best.agreement * clear,
            heading_deg=-math.degrees(best.pose.up_rad),
        )

    def picture(self) -> Image:
        """Return the white top with its tags, (H, W, 3) RGB."""
        return tag_board.draw_board(self.board, self._mark, _PICTURE_PX_PER_M)

    def _detect(self, image: Image) -> list[_Seen]:
        """Return the tags of the mark in an image; two prints of one tag come twice."""
        grey = np.asarray(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), dtype=np.uint8)
        corners, ids, _ = self._detector.detectMarkers(grey)
        found = []
        for place, square in zip([] if ids is None else ids.ravel(), corners, strict=True):
            rough = np.asarray(square, dtype=np.float64).reshape(4, 2)
            fine = refine_corners(grey, rough)
            edges_px = np.linalg.norm(fine - np.roll(fine, 1, axis=0), axis=1)
            found.append(_Seen(int(place), fine, float(edges_px.min())))
        return found

    def _fit(self, tags: Sequence[_Seen], view: MarkView) -> _Fit | None:
        """Return the pose of the mark by some tags; None if they do not lie on one board."""
        board_m = np.concatenate([self._corners_m[tag.place] for tag in tags])
        seen_px = np.concatenate([tag.corners_px for tag in tags])
        pose = level_pose(board_m, seen_px, view.camera, view.frame.gimbal_pitch_rad)
        edge_px = max(tag.edge_px for tag in tags)
        if pose is None or pose.error_px > max(_WORST_PX, _WORST_SHARE * edge_px):
            return None
        agreement, camera_m = 1.0, view.frame.height_above_ground_m
        if math.isfinite(camera_m):
            off_m = abs(camera_m - pose.down_m - self._mark.height_m)
            range_m = math.hypot(pose.forward_m, pose.right_m, pose.down_m)
            agreement = min(1.0, (_HEIGHT_M + _HEIGHT_SHARE * range_m) / max(off_m, 1e-9))
        return _Fit(pose, edge_px, agreement, len(tags) * agreement)

    def _around(self, first: _Seen, seen: Sequence[_Seen], view: MarkView) -> _Fit | None:
        """Return the pose of the mark by a tag and the others that fit it."""
        alone = self._fit([first], view)
        if alone is None:
            return None
        near: dict[int, tuple[float, _Seen]] = {}
        for tag in seen:
            placed = placed_corners(self._corners_m[tag.place], alone.pose)
            expected_px = project(placed, view.camera, view.frame.gimbal_pitch_rad)
            off = float(np.abs(expected_px - tag.corners_px).max()) / tag.edge_px
            if off < near.get(tag.place, (_NEAR_SHARE,))[0]:
                near[tag.place] = off, tag
        return self._fit([tag for _, tag in near.values()] or [first], view) or alone


class AprilTagFinder(TagFinder):
    """Finds AprilTags, as AprilTag's own images show them; implements `MarkFinder`."""

    families = tag_board.APRILTAG_FAMILIES
    options = tag_board.AprilTagOptions


class ArucoFinder(TagFinder):
    """Finds ArUco markers; implements `MarkFinder`."""

    families = tag_board.ARUCO_FAMILIES
