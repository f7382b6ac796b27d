"""The simplest depth from masks, to compare with: a thing is as far as its lowest pixel."""

from __future__ import annotations

from collections.abc import Iterator

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.camera.ground_plane import CameraView, ground_depth
from uav_bt.classes import BOXES, CARPET, HELIPAD_BOX, HELIPAD_H, ROOFS
from uav_bt.errors import ShapeError

__all__ = ["lowest_pixel_depth"]


def lowest_pixel_depth(ids: NDArray[np.uint8], view: CameraView) -> NDArray[np.float32]:
    """Give each connected thing the depth of the ground where its lowest pixel is.

    A box and its roof are one thing. Nothing is known of the background.

    Args:
        ids: (H, W) class ids.
        view: the camera, at the map's size.

    Returns:
        (H, W) float32 metres along the optical axis; NaN where unknown.

    Raises:
        ShapeError: the map's size is not the view's.
        ValueRangeError: the lens is not above the carpet.
    """
    size = (view.camera.height_px, view.camera.width_px)
    if ids.shape != size:
        expected = f"{size[0]}x{size[1]}, as its camera"
        raise ShapeError("class map", expected=expected, actual=ids.shape)
    ground = ground_depth(view)
    depth = np.where(ids == CARPET, ground, np.float32(np.nan))
    for thing in _things(ids):
        rows, columns = np.nonzero(thing)
        lowest = int(rows.max())
        depth[thing] = np.median(ground[lowest, columns[rows == lowest]])
    return depth


def _things(ids: NDArray[np.uint8]) -> Iterator[NDArray[np.bool_]]:
    """Give the connected parts of every box with its roof, and of the helipad."""
    wholes = [((box, ROOFS[number % len(ROOFS)]), box) for number, box in enumerate(BOXES)]
    wholes.append(((HELIPAD_BOX, HELIPAD_H), HELIPAD_BOX))
    for members, needed in wholes:
        mask = np.isin(ids, members)
        count, labels = cv2.connectedComponents(mask.astype(np.uint8), connectivity=4)
        for label in range(1, count):
            part = labels == label
            # Two boxes may wear the same roof: the one with a side below it has it.
            if np.any(ids[part] == needed):
                yield part
