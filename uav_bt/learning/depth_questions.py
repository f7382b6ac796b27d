"""Edges and points whose lengths and distances are measured in depth maps, and their errors.

The paper (Mocanu et al.) evaluates depth by the dimensions of obstacles: a person picks two points
on the edges of an obstacle in the image, and their distance in space is compared with a tape
measure's. Here the exact class map replaces the person. The outline of each visible face (a box's
sides, a roof) is simplified to a polygon, and two consecutive corners span an edge. Points drawn
at random have a distance from the camera.

A person clicks on the obstacle, not on the background, so the face is first eroded by two pixels of
the map. Corners at the image's border, and corners caused by a nearer obstacle in front, are left
out.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.camera.ground_plane import ray_lengths
from uav_bt.lab.classes import GROUND, OBSTACLE
from uav_bt.types import CameraModel, ClassMap
from uav_bt.types.arrays import Flags, Floats, Floats32, Indices

_INSET_PX: Final = 2  # from an outline inwards, because the border itself is ambiguous
_SQUARE: Final = np.ones((2 * _INSET_PX + 1, 2 * _INSET_PX + 1), dtype=np.uint8)
_SIMPLIFY_PX: Final = 1.5  # largest distance of the polygon from the outline: a pixel, rounded
_MIN_AREA_PX: Final = 60  # of a face; smaller ones are hard to click on
_MIN_CORNERS: Final = 3  # of a face; a line has no edges
_MIN_LENGTH_PX: Final = 6.0  # of an edge; an error of three pixels is half of this
_MIN_LENGTH_M: Final = 0.1  # of an edge, in space
_OCCLUDER_M: Final = 0.15  # a nearer object at a corner hides the face from this difference on
_MAX_EDGES: Final = 8  # per image, so that crowded images do not dominate
_POINTS: Final = 40  # per image on obstacles, and as many on the ground
_MIN_RANGE_M, _MAX_RANGE_M = 0.3, 5.0  # of points, along the ray; the paper's range of distances


def pick_edges(
    class_map: ClassMap, depth_m: Floats32, camera: CameraModel, generator: np.random.Generator
) -> Indices:
    """Return edges of one image, (N, 2, 2): two ends, column and row.

    Args:
        class_map: exact class map.
        depth_m: (H, W) exact depth along the optical axis.
        camera: intrinsics at that size.
        generator: chooses among surplus edges.
    """
    edges: list[Indices] = []
    for face in _faces(class_map):
        outlines, _ = cv2.findContours(face, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
        if not outlines:
            continue
        polygon = cv2.approxPolyDP(max(outlines, key=len), _SIMPLIFY_PX, closed=True)
        corners = polygon.reshape(-1, 2).astype(np.intp)
        if len(corners) < _MIN_CORNERS:
            continue
        good = np.array([_picked(corner, face, class_map, depth_m) for corner in corners])
        spans = np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)
        edges.extend(spans[good & np.roll(good, -1)])
    found = np.array(edges, dtype=np.intp).reshape(-1, 2, 2)
    length_px = np.linalg.norm((found[:, 0] - found[:, 1]).astype(np.float64), axis=1)
    length_m = edge_lengths(depth_m, found, camera)
    found = found[(length_px >= _MIN_LENGTH_PX) & (length_m >= _MIN_LENGTH_M)]
    return generator.permutation(found)[:_MAX_EDGES]


def _faces(class_map: ClassMap) -> Iterator[NDArray[np.uint8]]:
    """Yield every connected region of an obstacle's class, without its rim."""
    for obstacle in class_map.classes.of_role(OBSTACLE):
        mask = (class_map.ids == obstacle).astype(np.uint8)
        count, labels, stats, _ = cv2.connectedComponentsWithStats(mask, connectivity=4)
        for label in range(1, count):
            if stats[label, cv2.CC_STAT_AREA] >= _MIN_AREA_PX:
                face = (labels == label).astype(np.uint8)
                # The image's border is not a rim, because the face continues beyond it.
                padded = cv2.copyMakeBorder(face, *(4 * (_INSET_PX,)), cv2.BORDER_REPLICATE)
                core = cv2.erode(padded, _SQUARE)[_INSET_PX:-_INSET_PX, _INSET_PX:-_INSET_PX]
                yield np.asarray(core, dtype=np.uint8)


def _picked(
    corner: Indices, face: NDArray[np.uint8], class_map: ClassMap, depth_m: Floats32
) -> bool:
    """Return whether a corner belongs to the obstacle and not to an occluder."""
    column, row = int(corner[0]), int(corner[1])
    reach, ids = _INSET_PX + 1, class_map.ids
    height, width = ids.shape
    if not (reach <= column < width - reach and reach <= row < height - reach):
        return False
    reach += 1
    near = np.s_[max(0, row - reach) : row + reach + 1, max(0, column - reach) : column + reach + 1]
    # The ground before a base is nearer, but does not hide it.
    others = class_map.is_above_ground[near] & (ids[near] != ids[row, column]) & (face[near] == 0)
    return not bool(np.any(others & (depth_m[near] < depth_m[row, column] - _OCCLUDER_M)))


def edge_lengths(depth_m: Floats32, edges: Indices, camera: CameraModel) -> Floats:
    """Return the lengths of edges in space by a depth map, (N,) metres; NaN where unknown."""
    columns, rows = edges[..., 0], edges[..., 1]
    depth = depth_m[rows, columns].astype(np.float64)
    x = (columns - camera.cx_px) / camera.fx_px * depth
    y = (rows - camera.cy_px) / camera.fy_px * depth
    ends = np.stack([x, y, depth], axis=-1)
    return np.asarray(np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1))


@dataclass(frozen=True)
class MeasuredPoints:
    """N pixels with their true range and kind."""

    pixels: Indices  # (N, 2) column, row
    range_m: Floats  # (N,) true distance from the lens along the ray
    obstacle: Flags  # (N,) True for obstacles, False for ground


def draw_points(
    class_map: ClassMap, depth_m: Floats32, camera: CameraModel, generator: np.random.Generator
) -> MeasuredPoints:
    """Sample points of one image, uniformly over its pixels; arguments as `pick_edges`."""
    ids, roles = class_map.ids, class_map.roles
    range_m = depth_m * ray_lengths(camera)
    inner = cv2.erode(ids, _SQUARE) == cv2.dilate(ids, _SQUARE)
    inner &= (range_m >= _MIN_RANGE_M) & (range_m <= _MAX_RANGE_M)
    chosen = []
    for role in (OBSTACLE, GROUND):
        places = np.flatnonzero(inner & (roles == role))
        chosen.append(generator.choice(places, size=min(_POINTS, places.size), replace=False))
    rows, columns = np.divmod(np.concatenate(chosen), ids.shape[1])
    return MeasuredPoints(
        pixels=np.stack([columns, rows], axis=1),
        range_m=range_m[rows, columns].astype(np.float64),
        obstacle=roles[rows, columns] == OBSTACLE,
    )


def ranges_at(depth_m: Floats32, points: MeasuredPoints, camera: CameraModel) -> Floats:
    """Return the points' ranges from a depth map, (N,) metres; NaN where unknown."""
    columns, rows = points.pixels.T
    return np.asarray((depth_m * ray_lengths(camera))[rows, columns], dtype=np.float64)


@dataclass(frozen=True)
class ErrorSummary:
    """Of absolute errors, metres; NaN where too few estimates have such a figure."""

    total: int  # estimates that were wanted
    valid: int  # those that were given; all figures below are about them
    mean_m: float = math.nan
    median_m: float = math.nan
    rmse_m: float = math.nan
    std_m: float = math.nan  # of the absolute error, as in the paper: rmse^2 = mean^2 + std^2
    max_m: float = math.nan
    correlation: float = math.nan  # Pearson's, of estimates with the truth


def summarise_errors(estimated_m: Floats, truth_m: Floats) -> ErrorSummary:
    """Summarise estimates of lengths, (N,) metres, NaN without an estimate."""
    known = np.isfinite(estimated_m)
    estimated, truth = estimated_m[known].astype(np.float64), truth_m[known].astype(np.float64)
    if not estimated.size:
        return ErrorSummary(truth_m.size, 0)
    error = np.abs(estimated - truth)
    a, b = estimated - estimated.mean(), truth - truth.mean()
    size = math.sqrt(float(a @ a) * float(b @ b))
    return ErrorSummary(
        total=truth_m.size,
        valid=estimated.size,
        mean_m=float(error.mean()),
        median_m=float(np.median(error)),
        rmse_m=math.sqrt(float(np.mean(error**2))),
        std_m=float(error.std()),
        max_m=float(error.max()),
        correlation=float(a @ b) / size if size > 0.0 else math.nan,
    )
