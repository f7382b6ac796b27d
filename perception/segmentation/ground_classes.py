"""What counts as ground where there is no carpet."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from uav_bt.classes import CARPET, class_id
from uav_bt.protocols import Segmenter
from uav_bt.types import ClassMap, Frame


class CountedAsCarpet:
    """A segmenter whose classes of ground all become carpet, by which missions fly.

    Args:
        segmenter: tells the classes apart.
        ground: names of the classes that a drone may fly over and scale its depth by.

    Raises:
        UnknownNameError: there is no class of a name.
    """

    def __init__(self, segmenter: Segmenter, ground: Iterable[str]) -> None:
        self._segmenter = segmenter
        self._table = np.arange(256, dtype=np.uint8)
        self._table[[class_id(name) for name in ground]] = CARPET

    def segment(self, frame: Frame) -> ClassMap:
        """Return the class map, ground as carpet."""
        class_map = self._segmenter.segment(frame)
        return replace(class_map, ids=self._table[class_map.ids])
