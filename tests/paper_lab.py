"""The classes of the lab of tests that draw class maps: the paper's, or that of `--lab`."""

from __future__ import annotations

from typing import Final

from uav_bt.lab.classes import OUTSIDE
from uav_bt.lab.shipped import load_lab
from uav_bt.types import ClassMap
from uav_bt.types.arrays import Image


def _known(class_id: int | None) -> int:
    assert class_id is not None, "the lab of the tests needs a landing box with a top"
    return class_id


CLASSES: Final = load_lab("paper").classes
CLASS_COUNT: Final = len(CLASSES)

BACKGROUND: Final = CLASSES.of_role(OUTSIDE)[0]
CARPET: Final = CLASSES.ground
HELIPAD_H: Final = _known(CLASSES.mark_top)
HELIPAD_BOX: Final = _known(CLASSES.mark_sides)
BOXES: Final = CLASSES.standing  # the sides of boxes 1 to 8
ROOFS: Final = tuple(dict.fromkeys(int(CLASSES.top_of[each]) for each in BOXES))


def paper_map(ids: Image, captured_s: float = 0.0) -> ClassMap:
    """Return a class map of the paper's lab from class ids, (H, W) uint8."""
    return ClassMap(ids=ids, classes=CLASSES, captured_s=captured_s)
