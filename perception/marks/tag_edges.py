"""Corners of a tag as the crossings of its edges, finer than a pixel.

A detector's corners lie up to half a pixel inside a blurred black square, which makes it appear
smaller and farther away. The edges do not move when the image is blurred. The method is that of
AprilTag's `refine_edges` (Wang and Olson, "AprilTag 2", IROS 2016).
"""

from __future__ import annotations

from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from uav_bt.types.arrays import Floats

_REACH_PX: Final = 2.0  # distance from the rough edge in which the real one is searched
_STEP_PX: Final = 0.25
_SAMPLES: Final = 24  # along an edge
_INNER: Final = (0.1, 0.9)  # part of an edge that is sampled: corners are rounded
_LEAST_SAMPLES: Final = 6
_MOST_MOVED_PX: Final = 3.0  # a corner that moves farther was not on the tag


def refine_corners(grey: NDArray[np.uint8], corners_px: Floats) -> Floats:
    """Return the corners of a dark square on a light ground, from lines along its edges.

    Corners are (4, 2) in turn, as (column, row); the rough ones if an edge is not found.
    """
    middle = corners_px.mean(axis=0)
    lines = []
    for begin, end in zip(corners_px, np.roll(corners_px, -1, axis=0), strict=True):
        along = (end - begin) / max(float(np.linalg.norm(end - begin)), 1e-9)
        outwards = np.array([along[1], -along[0]])
        if outwards @ (begin - middle) < 0.0:
            outwards = -outwards
        line = _edge(grey, begin, end, outwards)
        if line is None:
            return corners_px
        lines.append(line)
    # Corner i lies between the edge before it and the edge after it.
    refined = [_crossing(lines[index - 1], lines[index]) for index in range(4)]
    if any(each is None for each in refined):
        return corners_px
    found = np.array(refined, dtype=np.float64)
    moved_px = np.linalg.norm(found - corners_px, axis=1)
    return found if moved_px.max() <= _MOST_MOVED_PX else corners_px


def _edge(grey: NDArray[np.uint8], begin: Floats, end: Floats, outwards: Floats) -> Floats | None:
    """Return an edge as (normal x, normal y, distance); None without enough contrast.

    It goes roughly from `begin` to `end`; `outwards` is the unit normal away from the tag.
    """
    shares = np.linspace(*_INNER, _SAMPLES)[:, None]
    points = begin + shares * (end - begin)
    offsets_px = np.arange(-_REACH_PX, _REACH_PX + _STEP_PX / 2.0, _STEP_PX)
    # Brightness one pixel outside minus one pixel inside, at each offset: the weight of the offset.
    at = points[:, None, :] + offsets_px[None, :, None] * outwards
    rise = _sampled(grey, at + outwards) - _sampled(grey, at - outwards)
    weights = np.maximum(rise, 0.0) ** 2
    total = weights.sum(axis=1)
    sure = total > 0.0
    if np.count_nonzero(sure) < _LEAST_SAMPLES:
        return None
    shift_px = (weights[sure] * offsets_px).sum(axis=1) / total[sure]
    found = points[sure] + shift_px[:, None] * outwards
    centre = found.mean(axis=0)
    _, _, axes = np.linalg.svd(found - centre)
    normal = axes[1]
    return np.array([*normal, normal @ centre])


def _sampled(grey: NDArray[np.uint8], points: Floats) -> Floats:
    """Return the brightness at points (N, M, 2) as (N, M), between pixels bilinearly."""
    columns, rows = points[..., 0].astype(np.float32), points[..., 1].astype(np.float32)
    values = grey.astype(np.float32)
    border = cv2.BORDER_REPLICATE
    found = cv2.remap(values, columns, rows, cv2.INTER_LINEAR, borderMode=border)
    return np.asarray(found, dtype=np.float64)


def _crossing(first: Floats, second: Floats) -> Floats | None:
    """Return the point on two lines (normal x, normal y, distance); None if they are parallel."""
    normals = np.stack([first[:2], second[:2]])
    if abs(np.linalg.det(normals)) < 1e-6:
        return None
    return np.linalg.solve(normals, np.array([first[2], second[2]]))
