"""What counts as ground where there is no carpet."""

from __future__ import annotations

import numpy as np
import pytest

from perception.segmentation.ground_classes import CountedAsCarpet
from uav_bt.classes import BACKGROUND, CARPET, HELIPAD_H
from uav_bt.errors import UnknownNameError
from uav_bt.types import ClassMap, Frame


class Told:
    """A segmenter that says what it was made with."""

    def __init__(self, *ids: int) -> None:
        self._ids = np.array([ids], np.uint8)

    def segment(self, frame: Frame) -> ClassMap:
        return ClassMap(ids=self._ids, captured_s=frame.captured_s)


FRAME = Frame(image=np.zeros((2, 2, 3), np.uint8), index=0, captured_s=3.0, gimbal_pitch_rad=0.0)


def test_classes_of_ground_become_carpet_and_others_stay() -> None:
    segmenter = CountedAsCarpet(Told(BACKGROUND, CARPET, HELIPAD_H, 7), ["carpet", "background"])
    told = segmenter.segment(FRAME)
    assert told.ids.tolist() == [[CARPET, CARPET, HELIPAD_H, 7]]
    assert told.captured_s == 3.0


def test_an_unknown_class_is_refused_with_a_suggestion() -> None:
    with pytest.raises(UnknownNameError, match="did you mean 'carpet'"):
        CountedAsCarpet(Told(0), ["carpets"])
