"""The helipad: an H on top of a box or mat with striped sides, found in class maps."""

from __future__ import annotations

import math
from typing import Final

from perception.marks.helipad_detector import HelipadDetector, locate, visible_share
from perception.marks.mark_options import refuse_unknown
from uav_bt.landing_marks import MarkSighting, MarkView
from uav_bt.types import LandingMark

# A smaller share of a whole H is a mask error; on boxes such errors reach 0.02. Only from right
# above the pad, within _ABOVE_M, may the visible share of the H be smaller.
_SPECK: Final = 0.1
_ABOVE_M: Final = 0.5


class HelipadFinder:
    """Finds the helipad by its two classes; implements `MarkFinder`.

    Args:
        mark: Size and height of the mark. It takes no options.

    Raises:
        ValueRangeError: An option is given.
    """

    uses_images = False
    shows_heading = False  # an H looks the same after half a turn

    def __init__(self, mark: LandingMark) -> None:
        refuse_unknown(mark, ())
        self._mark = mark
        self._detector = HelipadDetector()

    def find(self, view: MarkView) -> MarkSighting | None:
        """Return the helipad in a class map; mask noise gives None."""
        class_map, frame = view.class_map, view.frame
        if class_map is None or not math.isfinite(
            frame.height_above_ground_m + frame.gimbal_pitch_rad
        ):
            return None
        detection = self._detector.detect(class_map)
        if detection is None:
            return None
        height_px, width_px = class_map.ids.shape
        lens = (
            view.camera.resized(width_px, height_px),
            frame.gimbal_pitch_rad,
            frame.height_above_ground_m - self._mark.height_m,
        )
        place = locate(detection, *lens)
        if place is None:
            return None
        share = visible_share(detection, *lens, self._mark)
        if share < _SPECK and math.hypot(*place) > _ABOVE_M:
            return None
        return MarkSighting(
            forward_m=place[0],
            right_m=place[1],
            height_m=self._mark.height_m,
            confidence=detection.score * share,  # the centroid of a partial H is biased
        )

    def picture(self) -> None:
        """Return None: the paper's lab has the H and its stripes."""
