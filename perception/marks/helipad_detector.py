"""Detector of the helipad in a class map, as a pair of its H and its striped box.

After the paper, section "First Level": candidate pairs are scored by distance, connectedness and
compactness. Distances are measured relative to the size of the H, so that the same thresholds hold
at every range.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from uav_bt.types import CameraModel, ClassMap, LandingMark
from uav_bt.types.projection import ground_points

H_SHARE: Final = 0.6  # of the mark's top: the panel of the class with the H


@dataclass(frozen=True, kw_only=True)
class HelipadDetectorConfig:
    """Thresholds of the pair search; areas are pixels of a 224x112 class map."""

    min_h_area_px: float = 8.0  # an H at 4.5 m covers about 20
    min_box_area_px: float = 12.0  # sides of the box at 4.5 m cover about 60
    max_gap: float = 0.5  # between the components' edges, in H diameters
    min_fill: float = 0.35  # share of the H's convex hull; scattered noise fills less
    min_score: float = 0.35
    # The score of an H cut by the image's border is multiplied by this: its centroid is up to
    # 0.17 m off.
    cut_share: float = 0.5
    max_components: int = 6  # of each class, largest first


@dataclass(frozen=True, kw_only=True)
class HelipadDetection:
    """The best pair of a class map."""

    column_px: float  # centroid of the H, at the class map's size
    row_px: float
    score: float  # 0 to 1
    h_area_px: float  # pixels of the class map
    cut_by_edge: bool  # the H touches the image's border: its centroid is biased


@dataclass(frozen=True)
class _Component:
    mask: NDArray[np.uint8]
    area_px: float
    centroid: tuple[float, float]


def _components(binary: NDArray[np.uint8], min_area_px: float, limit: int) -> list[_Component]:
    count, labels, stats, centroids = cv2.connectedComponentsWithStats(binary, connectivity=8)
    order = sorted(range(1, count), key=lambda i: -int(stats[i, cv2.CC_STAT_AREA]))[:limit]
    return [
        _Component(
            mask=(labels == i).astype(np.uint8),
            area_px=float(stats[i, cv2.CC_STAT_AREA]),
            centroid=(float(centroids[i][0]), float(centroids[i][1])),
        )
        for i in order
        if stats[i, cv2.CC_STAT_AREA] >= min_area_px
    ]


def _hull_fill(component: _Component) -> float:
    points = cv2.findNonZero(component.mask)
    hull_area = cv2.contourArea(cv2.convexHull(points))
    # A hull through pixel centres is half a pixel too small on each side, so the ratio may exceed
    # 1 for small shapes.
    return min(1.0, component.area_px / hull_area) if hull_area > 0 else 1.0


class HelipadDetector:
    """Scores pairs of an H component and a box component."""

    def __init__(self, config: HelipadDetectorConfig | None = None) -> None:
        self._config = config or HelipadDetectorConfig()

    def detect(self, class_map: ClassMap) -> HelipadDetection | None:
        """Return the pair with the highest score, or None when no pair reaches `min_score`."""
        cfg = self._config
        height, width = class_map.ids.shape
        scale = (width * height) / (224.0 * 112.0)
        h_parts = _components(
            (class_map.ids == class_map.classes.mark_top).astype(np.uint8),
            cfg.min_h_area_px * scale,
            cfg.max_components,
        )
        if not h_parts:
            return None
        box_parts = _components(
            (class_map.ids == class_map.classes.mark_sides).astype(np.uint8),
            cfg.min_box_area_px * scale,
            cfg.max_components,
        )
        best: tuple[float, _Component] | None = None
        for h_part in h_parts:
            to_h = cv2.distanceTransform(1 - h_part.mask, cv2.DIST_L2, 3)
            for box_part in box_parts:
                score = self._score(h_part, box_part, to_h)
                if score >= cfg.min_score and (best is None or score > best[0]):
                    best = score, h_part
        return self._detection(best[1], best[0]) if best is not None else None

    def _score(self, h: _Component, box: _Component, to_h: NDArray[Any]) -> float:
        cfg = self._config
        diameter = math.sqrt(4.0 * h.area_px / math.pi)
        # Neighbouring pixels are at distance 1, which is a gap of 0.
        gap = max(0.0, float(to_h[box.mask > 0].min()) - 1.0) / diameter
        if gap > cfg.max_gap:
            return 0.0
        fill = _hull_fill(h)
        if fill < cfg.min_fill:
            return 0.0
        connectedness = 1.0 - gap / cfg.max_gap
        # From any viewpoint the centroids of box and H are within about two H diameters.
        apart = math.dist(h.centroid, box.centroid) / diameter
        proximity = math.exp(-max(0.0, apart - 1.0) / 2.0)
        return math.cbrt(connectedness * proximity * fill)

    def _detection(self, h: _Component, score: float) -> HelipadDetection:
        edges = (h.mask[0, :], h.mask[-1, :], h.mask[:, 0], h.mask[:, -1])
        cut = any(bool(edge.any()) for edge in edges)
        return HelipadDetection(
            column_px=h.centroid[0],
            row_px=h.centroid[1],
            score=score * self._config.cut_share if cut else score,
            h_area_px=h.area_px,
            cut_by_edge=cut,
        )


def locate(
    detection: HelipadDetection,
    camera: CameraModel,
    gimbal_pitch_rad: float,
    height_above_pad_m: float,
) -> tuple[float, float] | None:
    """Return the position of a detection from the body's centre, metres.

    In perspective the near half of the H is larger, so that its centroid lies up to 3 cm before the
    pad's centre. A camera that looks straight down does not have this error.

    Args:
        detection: detection in a class map.
        camera: intrinsics at the class map's size.
        gimbal_pitch_rad: pitch of the gimbal at the frame's capture.
        height_above_pad_m: height of the camera above the pad's top.

    Returns:
        (forward, right) metres in the level frame, or None when the ray does not meet the pad's
        plane within 15 m (no lab is longer).
    """
    if height_above_pad_m <= 0.0:
        return None
    forward, right = ground_points(
        [detection.column_px, detection.row_px], camera, gimbal_pitch_rad, height_above_pad_m
    )
    if not math.hypot(forward, right) < 15.0:
        return None
    return float(forward) + camera.forward_offset_m, float(right)


def visible_share(
    detection: HelipadDetection,
    camera: CameraModel,
    gimbal_pitch_rad: float,
    height_above_pad_m: float,
    mark: LandingMark,
) -> float:
    """Return the share of a whole H in a detection, from its area on the pad's plane.

    The share is small for an H cut by the image's border, and for mask noise on a nearby box.

    Args:
        detection: a detection for which `locate` returns a position with the same arguments.
        camera: intrinsics at the class map's size.
        gimbal_pitch_rad: pitch of the gimbal at the frame's capture.
        height_above_pad_m: height of the camera above the pad's top.
        mark: the size of the mark.

    Returns:
        0 to 1.
    """
    middle = np.array([detection.column_px, detection.row_px])
    half = 0.5 * np.array([[-1, 0], [1, 0], [0, -1], [0, 1]])
    left, right, top, bottom = ground_points(
        middle + half, camera, gimbal_pitch_rad, height_above_pad_m
    )
    across, down = right - left, bottom - top
    pixel_m2 = abs(float(across[0] * down[1] - across[1] * down[0]))
    return min(1.0, detection.h_area_px * pixel_m2 / (H_SHARE * mark.area_m2))
