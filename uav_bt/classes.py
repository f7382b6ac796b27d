"""The seventeen classes of the lab, their four groups for mission planning, and their colours.

The classes are those of Mocanu et al. (arXiv 2510.16624): background, carpet, two for the helipad,
one for each box and for each roof structure. The groups are the paper's four categories for mission
planning. The whole project uses these ids; those of a foreign network are translated
(`perception.segmentation.mapping`).
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from uav_bt.errors import UnknownNameError, ValueRangeError

BACKGROUND: Final = 0
CARPET: Final = 1
HELIPAD_H: Final = 2
HELIPAD_BOX: Final = 3
BOXES: Final = tuple(range(4, 12))  # the sides of boxes 1 to 8
ROOFS: Final = tuple(range(12, 17))  # box k carries roof ((k - 1) mod 5) + 1
OBSTACLES: Final = BOXES + ROOFS

CLASS_NAMES: Final = (
    "background",
    "carpet",
    "helipad_h",
    "helipad_box",
    *(f"box_{number}" for number in range(1, 9)),
    *(f"roof_{number}" for number in range(1, 6)),
)
CLASS_COUNT: Final = len(CLASS_NAMES)

GROUP_BACKGROUND: Final = 0
GROUP_CARPET: Final = 1
GROUP_HELIPAD: Final = 2
GROUP_OBSTACLE: Final = 3
GROUP_NAMES: Final = ("background", "carpet", "helipad", "obstacle")
GROUP_COUNT: Final = len(GROUP_NAMES)


def _frozen(array: NDArray[np.uint8]) -> NDArray[np.uint8]:
    array.flags.writeable = False
    return array


CLASS_TO_GROUP: Final = _frozen(
    np.array(
        [GROUP_BACKGROUND, GROUP_CARPET, GROUP_HELIPAD, GROUP_HELIPAD]
        + [GROUP_OBSTACLE] * len(OBSTACLES),
        dtype=np.uint8,
    )
)
"""(17,) uint8: the group id of each class id."""

ROOF_OF_CLASS: Final = _frozen(
    np.array(
        [
            ROOFS[BOXES.index(each) % len(ROOFS)] if each in BOXES else 0
            for each in range(CLASS_COUNT)
        ],
        dtype=np.uint8,
    )
)
"""(17,) uint8: the class of the roof on the sides of each class; 0 without one."""

CLASS_COLOURS: Final = _frozen(
    np.array(
        [
            (40, 40, 48),  # background
            (126, 158, 120),  # carpet
            (255, 255, 255),  # helipad H
            (255, 196, 0),  # helipad box
            (214, 39, 40),  # box 1
            (31, 119, 180),
            (148, 103, 189),
            (140, 86, 75),
            (227, 119, 194),
            (23, 190, 207),
            (255, 127, 14),
            (44, 160, 44),  # box 8
            (120, 20, 20),  # roof 1
            (20, 70, 110),
            (90, 60, 115),
            (85, 50, 45),
            (140, 70, 120),  # roof 5
        ],
        dtype=np.uint8,
    )
)
"""(17, 3) uint8 RGB: for images of class maps."""

NO_CLASS: Final = 255
"""Value of a sample outside the image: neither a class nor a group."""

# 256 entries: a bad id is found after the look-up, without a second pass over the map.
_GROUP_TABLE: Final = np.full(256, NO_CLASS, dtype=np.uint8)
_GROUP_TABLE[:CLASS_COUNT] = CLASS_TO_GROUP


def class_id(name: str) -> int:
    """Return the id of a class name.

    Raises:
        UnknownNameError: there is no such class; the message suggests the closest one.
    """
    if name not in CLASS_NAMES:
        raise UnknownNameError("class", name, CLASS_NAMES)
    return CLASS_NAMES.index(name)


def group_of(ids: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return the group ids of class ids.

    Args:
        ids: class ids, uint8, any shape.

    Returns:
        Group ids, uint8, of the same shape.

    Raises:
        ValueRangeError: an id is not one of the seventeen, or the array is not uint8.
    """
    if ids.dtype != np.uint8:
        raise ValueRangeError(f"class ids must be uint8, got {ids.dtype}")
    groups = _GROUP_TABLE.take(ids)
    if groups.size and int(groups.max()) == NO_CLASS:
        raise ValueRangeError(
            f"class ids must lie within 0 and {CLASS_COUNT - 1}, got {int(ids.max())}"
        )
    return groups


def is_ground(ids: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """Return where class ids, uint8 of any shape, are the ground that a mission flies over."""
    return np.asarray(group_of(ids) == GROUP_CARPET)


def is_above_ground(ids: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """Return where class ids, uint8 of any shape, are obstacles or the landing mark's box."""
    groups = group_of(ids)
    return np.asarray((groups == GROUP_HELIPAD) | (groups == GROUP_OBSTACLE))


def standing_classes() -> tuple[int, ...]:
    """Return the ids of the obstacles whose base meets the ground: all but roofs."""
    obstacles = np.flatnonzero(CLASS_TO_GROUP == GROUP_OBSTACLE)
    return tuple(int(class_id) for class_id in obstacles if class_id not in ROOFS)


def colourise(ids: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return a class map as a colour image.

    Args:
        ids: (H, W) uint8 class ids.

    Returns:
        (H, W, 3) uint8 RGB.

    Raises:
        ValueRangeError: an id is not one of the seventeen.
    """
    group_of(ids)  # refuses bad ids
    return CLASS_COLOURS[ids]
