"""The helipad: an H on top of a box or mat with striped sides, found in class maps.

After the paper, section "First Level": pairs of an H and a striped box are scored by distance,
connectedness and compactness. Distances are measured relative to the size of the H, so that the
same thresholds hold at every range.
"""

from __future__ import annotations

import math
from typing import Any, Final, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from uav_bt.landing_marks import MarkSighting, MarkView, Options, read_options
from uav_bt.types import ClassMap, LandingMark
from uav_bt.types.projection import ground_points

H_AREA_SHARE: Final = 0.6  # of the mark's top: the panel of the class with the H
# A smaller share of a whole H is a mask error; on boxes such errors reach 0.02. Only from right
# above the pad, within _ABOVE_M, may the visible share of the H be smaller.
_SPECK: Final = 0.1
_ABOVE_M: Final = 0.5
_FARTHEST_M: Final = 15.0  # no lab is longer
_MAP_PX: Final = 224.0 * 112.0  # size of a class map to which the areas below refer
_MIN_H_PX: Final = 8.0  # an H at 4.5 m covers about 20
_MIN_BOX_PX: Final = 12.0  # sides of the box at 4.5 m cover about 60
_MAX_GAP: Final = 0.5  # between the components' edges, in H diameters
_MIN_FILL: Final = 0.35  # share of the H's convex hull; scattered noise fills less
_MIN_SCORE: Final = 0.35
_CUT_SHARE: Final = 0.5  # of the score of an H cut by the border: its centroid is up to 0.17 m off
_MAX_PARTS: Final = 6  # of each class, largest first


class Part(NamedTuple):
    """A connected component of a class map."""

    mask: NDArray[np.uint8]
    area_px: float
    centroid: tuple[float, float]  # column, row


class HelipadFinder:
    """Finds the helipad by its two classes; implements `MarkFinder`. It takes no options."""

    uses_images = False
    shows_heading = False  # an H looks the same after half a turn

    def __init__(self, mark: LandingMark) -> None:
        read_options(mark, Options)
        self._mark = mark

    def find(self, view: MarkView) -> MarkSighting | None:
        """Return the helipad in a class map; mask noise gives None."""
        class_map, pitch_rad = view.class_map, view.frame.gimbal_pitch_rad
        above_m = view.frame.height_above_ground_m - self._mark.height_m
        if class_map is None or not (above_m > 0.0 and math.isfinite(pitch_rad)):
            return None
        pair = best_pair(class_map)
        if pair is None:
            return None
        h, score = pair
        camera = view.camera.resized(*class_map.ids.shape[::-1])
        # In perspective the near half of the H is larger, so that its centroid lies up to 3 cm
        # before the pad's centre, except seen from straight above.
        ahead_m, right_m = ground_points(h.centroid, camera, pitch_rad, above_m)
        if not math.hypot(ahead_m, right_m) < _FARTHEST_M:
            return None
        forward_m = float(ahead_m) + camera.forward_offset_m
        sides = np.array(h.centroid) + 0.5 * np.array([[-1, 0], [1, 0], [0, -1], [0, 1]])
        left, right, top, bottom = ground_points(sides, camera, pitch_rad, above_m)
        across, down = right - left, bottom - top
        pixel_m2 = abs(float(across[0] * down[1] - across[1] * down[0]))
        share = min(1.0, h.area_px * pixel_m2 / (H_AREA_SHARE * self._mark.area_m2))
        if share < _SPECK and math.hypot(forward_m, right_m) > _ABOVE_M:
            return None
        return MarkSighting(
            forward_m=forward_m,
            right_m=float(right_m),
            height_m=self._mark.height_m,
            confidence=score * share,  # the centroid of a partial H is biased
        )

    def picture(self) -> None:
        """Return None: the paper's lab has the H and its stripes."""


def best_pair(class_map: ClassMap) -> tuple[Part, float] | None:
    """Return the H of the pair with the highest score, and the score; None without a pair."""
    ids, classes = class_map.ids, class_map.classes
    scale = ids.size / _MAP_PX
    h_parts = _parts(ids == classes.mark_top, _MIN_H_PX * scale)
    box_parts = _parts(ids == classes.mark_sides, _MIN_BOX_PX * scale) if h_parts else []
    pairs: list[tuple[Part | None, float]] = []
    for part in h_parts:
        to_h = cv2.distanceTransform(1 - part.mask, cv2.DIST_L2, 3)
        pairs += [(part, _score(part, box, to_h)) for box in box_parts]
    h, score = max(pairs, key=lambda pair: pair[1], default=(None, 0.0))
    if h is None or score < _MIN_SCORE:
        return None
    cut = any(edge.any() for edge in (h.mask[0], h.mask[-1], h.mask[:, 0], h.mask[:, -1]))
    return h, score * _CUT_SHARE if cut else score


def _parts(shown: NDArray[np.bool_], min_area_px: float) -> list[Part]:
    binary = np.asarray(shown, dtype=np.uint8)
    count, labels, stats, middles = cv2.connectedComponentsWithStats(binary, connectivity=8)
    areas_px = stats[:, cv2.CC_STAT_AREA]
    largest = sorted(range(1, count), key=lambda i: -int(areas_px[i]))[:_MAX_PARTS]
    return [
        Part((labels == i).astype(np.uint8), float(areas_px[i]), (float(x), float(y)))
        for i in largest
        if areas_px[i] >= min_area_px
        for x, y in [middles[i]]
    ]


def _score(h: Part, box: Part, to_h: NDArray[Any]) -> float:
    """Return the score of a pair, 0 to 1, from the distance of each pixel to the H."""
    diameter = math.sqrt(4.0 * h.area_px / math.pi)
    # Neighbouring pixels are at distance 1, which is a gap of 0.
    gap = max(0.0, float(to_h[box.mask > 0].min()) - 1.0) / diameter
    hull_px = cv2.contourArea(cv2.convexHull(cv2.findNonZero(h.mask)))
    # A hull through pixel centres is half a pixel too small on each side, so the ratio may exceed
    # 1 for small shapes.
    fill = min(1.0, h.area_px / hull_px) if hull_px > 0 else 1.0
    if gap > _MAX_GAP or fill < _MIN_FILL:
        return 0.0
    # From any viewpoint the centroids of box and H are within about two H diameters.
    apart = math.dist(h.centroid, box.centroid) / diameter
    proximity = math.exp(-max(0.0, apart - 1.0) / 2.0)
    return math.cbrt((1.0 - gap / _MAX_GAP) * proximity * fill)
