"""The twin's exact class ids in place of a segmentation network."""

from __future__ import annotations

import numpy as np

from uav_bt.lab.classes import LabClasses
from uav_bt.protocols import Referee
from uav_bt.types import ClassMap, Frame


class ExactSegmenter:
    """The twin's exact class ids as a segmenter: for evaluations, never for a mission's result.

    Args:
        referee: gives the exact class ids.
        classes: classes of the lab.
        size_px: width and height of the class maps.
    """

    def __init__(
        self, referee: Referee, classes: LabClasses, size_px: tuple[int, int] = (224, 112)
    ) -> None:
        self._referee, self._classes = referee, classes
        self._size_px = size_px

    def segment(self, frame: Frame) -> ClassMap:
        """Return the exact class map of a delivered frame."""
        ids = self._referee.class_ids(frame, *self._size_px)
        return ClassMap(
            ids=np.ascontiguousarray(ids), classes=self._classes, captured_s=frame.captured_s
        )
