"""Pairs of points on obstacles' edges, and their distance in space from a depth map.

The paper (Mocanu et al.) evaluates depth by the dimensions of obstacles: a person picks two points
on the edges of an obstacle in the image, and their distance in space is compared with a tape
measure's. Here the exact class map replaces the person. The outline of each visible face (a box's
sides, a roof) is simplified to a polygon. Its corners are the picked points, and two consecutive
corners span an edge.

A person clicks on the obstacle, not on the background, so the face is first eroded by two pixels of
the map. Corners at the image's border, and corners caused by a nearer obstacle in front, are left
out.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from uav_bt.errors import ShapeError, ValueRangeError
from uav_bt.lab.classes import OBSTACLE
from uav_bt.types import CameraModel, ClassMap
from uav_bt.types.arrays import Floats32, Indices

Mask = NDArray[np.uint8]

_MIN_CORNERS = 3  # of a face; a line has no edges


@dataclass(frozen=True, kw_only=True)
class PairConfig:
    """Which corners are picked."""

    inset_px: int = 2  # from the outline inwards, because the border itself is ambiguous
    simplify_px: float = 1.5  # largest distance of the polygon from the outline: a pixel, rounded
    min_area_px: int = 60  # of a face; smaller ones are hard to click on
    min_length_px: float = 6.0  # of an edge; an error of three pixels is half of this
    min_length_m: float = 0.1  # of an edge, in space
    occluder_m: float = 0.15  # a nearer object at a corner hides the face from this difference on
    max_edges: int = 8  # edges per image, so that crowded images do not dominate
    max_across: int = 4  # pairs per image with ends on two different faces

    def __post_init__(self) -> None:
        if self.inset_px < 0 or self.max_edges < 1 or self.max_across < 0:
            raise ValueRangeError(
                "pairs need inset_px >= 0, max_edges >= 1 and max_across >= 0, got "
                f"{self.inset_px}, {self.max_edges}, {self.max_across}"
            )


@dataclass(frozen=True, kw_only=True)
class PointPairs:
    """Pixels, column and row, of N pairs."""

    first: Indices  # (N, 2)
    second: Indices  # (N, 2)
    across: NDArray[np.bool_]  # (N,) whether the two are on different faces; else they span an edge

    def __len__(self) -> int:
        return len(self.across)


def pick_pairs(
    class_map: ClassMap,
    depth_m: Floats32,
    camera: CameraModel,
    generator: np.random.Generator,
    config: PairConfig | None = None,
) -> PointPairs:
    """Pick pairs in one image.

    Args:
        class_map: exact class map.
        depth_m: (H, W) exact depth along the optical axis.
        camera: intrinsics at that size.
        generator: chooses among surplus pairs, and the pairs across faces.
        config: which corners are picked.

    Raises:
        ShapeError: the sizes differ.
    """
    config = config or PairConfig()
    _check_size(class_map.ids, depth_m, camera)
    edges: list[NDArray[np.intp]] = []
    corners: list[NDArray[np.intp]] = []
    for face in _faces(class_map, config):
        outline = _polygon(face, config)
        if len(outline) < _MIN_CORNERS:
            continue
        good = np.array([_picked(corner, face, class_map, depth_m, config) for corner in outline])
        if not good.any():
            continue
        corners.append(outline[good])
        following, follows_good = np.roll(outline, -1, axis=0), np.roll(good, -1)
        edges.extend(np.stack([outline, following], axis=1)[good & follows_good])
    spans = np.array(edges, dtype=np.intp).reshape(-1, 2, 2)
    spans = spans[_long_enough(spans, depth_m, camera, config)]
    spans = generator.permutation(spans)[: config.max_edges]
    across = _across(corners, generator, config.max_across)
    pairs = np.concatenate([spans, across])
    return PointPairs(
        first=pairs[:, 0],
        second=pairs[:, 1],
        across=np.arange(len(pairs)) >= len(spans),
    )


def _check_size(ids: NDArray[np.uint8], depth_m: Floats32, camera: CameraModel) -> None:
    size = (camera.height_px, camera.width_px)
    for name, array in (("class map", ids), ("depth map", depth_m)):
        if array.shape != size:
            expected = f"{size[0]}x{size[1]}, as the camera"
            raise ShapeError(name, expected=expected, actual=array.shape)


def _faces(class_map: ClassMap, config: PairConfig) -> Iterator[Mask]:
    """Yield every connected region of an obstacle's class, without its rim."""
    for obstacle in class_map.classes.of_role(OBSTACLE):
        mask = (class_map.ids == obstacle).astype(np.uint8)
        if np.count_nonzero(mask) < config.min_area_px:
            continue
        count, labels, stats, _ = cv2.connectedComponentsWithStats(mask, connectivity=4)
        for label in range(1, count):
            if stats[label, cv2.CC_STAT_AREA] >= config.min_area_px:
                yield _less_rim((labels == label).astype(np.uint8), config.inset_px)


def _less_rim(mask: Mask, inset_px: int) -> Mask:
    if inset_px == 0:
        return mask
    # The image's border is not a rim, because the face continues beyond it.
    padded = cv2.copyMakeBorder(mask, *(4 * (inset_px,)), cv2.BORDER_REPLICATE)
    square = np.ones((2 * inset_px + 1, 2 * inset_px + 1), dtype=np.uint8)
    core = cv2.erode(padded, square)[inset_px:-inset_px, inset_px:-inset_px]
    return np.asarray(core, dtype=np.uint8)


def _polygon(face: Mask, config: PairConfig) -> Indices:
    """Return the corners of a face's largest part in order, (N, 2) column and row."""
    outlines, _ = cv2.findContours(face, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    if not outlines:
        return np.empty((0, 2), dtype=np.intp)
    largest = max(outlines, key=len)
    polygon = cv2.approxPolyDP(largest, config.simplify_px, closed=True)
    return polygon.reshape(-1, 2).astype(np.intp)


def _picked(
    corner: Indices, face: Mask, class_map: ClassMap, depth_m: Floats32, config: PairConfig
) -> bool:
    """Return whether a corner belongs to the obstacle and not to an occluder."""
    column, row = int(corner[0]), int(corner[1])
    reach = config.inset_px + 1
    ids = class_map.ids
    height, width = ids.shape
    if not (reach <= column < width - reach and reach <= row < height - reach):
        return False
    reach += 1
    window = np.s_[
        max(0, row - reach) : row + reach + 1, max(0, column - reach) : column + reach + 1
    ]
    # The ground before a base is nearer, but does not hide it.
    others = (
        class_map.is_above_ground[window] & (ids[window] != ids[row, column]) & (face[window] == 0)
    )
    return not bool(np.any(others & (depth_m[window] < depth_m[row, column] - config.occluder_m)))


def _long_enough(
    spans: Indices, depth_m: Floats32, camera: CameraModel, config: PairConfig
) -> NDArray[np.bool_]:
    length_px = np.linalg.norm((spans[:, 0] - spans[:, 1]).astype(np.float64), axis=1)
    ends = [_points(depth_m, spans[:, end], camera, 1) for end in (0, 1)]
    length_m = np.linalg.norm(ends[0] - ends[1], axis=1)
    long_enough = (length_px >= config.min_length_px) & (length_m >= config.min_length_m)
    return np.asarray(long_enough, dtype=np.bool_)


def _across(corners: list[Indices], generator: np.random.Generator, most: int) -> Indices:
    pairs = []
    if len(corners) > 1:
        for _ in range(most):
            faces = generator.choice(len(corners), size=2, replace=False)
            pairs.append([generator.choice(corners[face]) for face in faces])
    return np.array(pairs, dtype=np.intp).reshape(-1, 2, 2)


# --- distances from a depth map -------------------------------------------------------------------


def pair_distances(
    depth_m: Floats32, pairs: PointPairs, camera: CameraModel, *, patch_px: int = 1
) -> NDArray[np.float64]:
    """Return the distances in space between the two points of each pair, (N,) metres.

    Args:
        depth_m: (H, W) along the optical axis; NaN where unknown.
        pairs: pixels of that map.
        camera: intrinsics at that size.
        patch_px: the depth at a pixel is the median of a square of that side around it.

    Returns:
        NaN where one of the depths is unknown.

    Raises:
        ShapeError: the map is not of the camera's size.
        ValueRangeError: the patch's side is not odd and positive.
    """
    if depth_m.shape != (camera.height_px, camera.width_px):
        expected = f"{camera.height_px}x{camera.width_px}, as the camera"
        raise ShapeError("depth map", expected=expected, actual=depth_m.shape)
    ends = [_points(depth_m, pixels, camera, patch_px) for pixels in (pairs.first, pairs.second)]
    return np.asarray(np.linalg.norm(ends[0] - ends[1], axis=1))


def _points(
    depth_m: Floats32, pixels: Indices, camera: CameraModel, patch_px: int
) -> NDArray[np.float64]:
    """Return points in the camera's frame, (N, 3)."""
    depth = patch_depths(depth_m, pixels, patch_px)
    x = (pixels[:, 0] - camera.cx_px) / camera.fx_px
    y = (pixels[:, 1] - camera.cy_px) / camera.fy_px
    return np.stack([x * depth, y * depth, depth], axis=1)


def patch_depths(depth_m: Floats32, pixels: Indices, patch_px: int = 1) -> NDArray[np.float64]:
    """Return the median depth around pixels, (N,).

    A patch only smooths: if the depth of the pixel is unknown, so is that of its patch, which would
    be the depth of other objects.

    Args:
        depth_m: (H, W); NaN where unknown, which the median leaves out.
        pixels: (N, 2) column and row.
        patch_px: odd side of the square; parts outside the image are left out.

    Raises:
        ValueRangeError: the side is not odd and positive.
    """
    if patch_px < 1 or patch_px % 2 == 0:
        raise ValueRangeError(f"a patch needs an odd, positive side, got {patch_px}")
    reach = patch_px // 2
    padded = np.pad(depth_m.astype(np.float64), reach, constant_values=np.nan)
    windows = np.lib.stride_tricks.sliding_window_view(padded, (patch_px, patch_px))
    patches = windows[pixels[:, 1], pixels[:, 0]].reshape(len(pixels), patch_px * patch_px)
    medians = np.full(len(pixels), np.nan)
    known = np.isfinite(depth_m[pixels[:, 1], pixels[:, 0]])
    medians[known] = np.nanmedian(patches[known], axis=1)
    return medians
