"""Points whose distance from the camera one would measure with a tape: on obstacles and carpet."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.camera.ground_plane import ray_lengths
from uav_bt.classes import CLASS_TO_GROUP, GROUP_CARPET, GROUP_OBSTACLE
from uav_bt.errors import ShapeError, ValueRangeError
from uav_bt.types import CameraModel

Floats = NDArray[np.float32]


@dataclass(frozen=True, kw_only=True)
class PointConfig:
    """Which points are drawn."""

    each: int = 40  # an image, of obstacles and of the carpet
    inset_px: int = 2  # from the border of a class: one holds a tape to a thing, not past it
    nearest_m: float = 0.3  # along the ray; the paper's range of distances
    furthest_m: float = 5.0

    def __post_init__(self) -> None:
        if self.each < 1 or self.inset_px < 0 or not 0.0 <= self.nearest_m < self.furthest_m:
            raise ValueRangeError(
                "points need each >= 1, inset_px >= 0 and 0 <= nearest_m < furthest_m, got "
                f"{self.each}, {self.inset_px}, {self.nearest_m}, {self.furthest_m}"
            )


@dataclass(frozen=True, kw_only=True)
class MeasuredPoints:
    """N pixels and what is true there."""

    pixels: NDArray[np.intp]  # (N, 2) column, row
    range_m: NDArray[np.float64]  # (N,) true distance from the lens along the ray
    obstacle: NDArray[np.bool_]  # (N,) else carpet

    def __len__(self) -> int:
        return len(self.range_m)


def draw_points(
    ids: NDArray[np.uint8],
    depth_m: Floats,
    camera: CameraModel,
    generator: np.random.Generator,
    config: PointConfig | None = None,
) -> MeasuredPoints:
    """Draw points of one image, evenly over its pixels.

    Args:
        ids: (H, W) exact class ids.
        depth_m: (H, W) exact depth along the optical axis.
        camera: intrinsics at that size.
        generator: draws.
        config: which.

    Raises:
        ShapeError: the sizes differ.
    """
    config = config or PointConfig()
    size = (camera.height_px, camera.width_px)
    for name, array in (("class map", ids), ("depth map", depth_m)):
        if array.shape != size:
            expected = f"{size[0]}x{size[1]}, as the camera"
            raise ShapeError(name, expected=expected, actual=array.shape)
    range_m = depth_m * ray_lengths(camera)
    square = np.ones((2 * config.inset_px + 1, 2 * config.inset_px + 1), dtype=np.uint8)
    inner = cv2.erode(ids, square) == cv2.dilate(ids, square)
    inner &= (range_m >= config.nearest_m) & (range_m <= config.furthest_m)
    groups = CLASS_TO_GROUP[ids]
    chosen = []
    for group in (GROUP_OBSTACLE, GROUP_CARPET):
        places = np.flatnonzero(inner & (groups == group))
        chosen.append(generator.choice(places, size=min(config.each, places.size), replace=False))
    rows, columns = np.divmod(np.concatenate(chosen), ids.shape[1])
    return MeasuredPoints(
        pixels=np.stack([columns, rows], axis=1),
        range_m=range_m[rows, columns].astype(np.float64),
        obstacle=groups[rows, columns] == GROUP_OBSTACLE,
    )


def ranges_at(depth_m: Floats, points: MeasuredPoints, camera: CameraModel) -> NDArray[np.float64]:
    """Return what a depth map tells of the points' ranges, (N,) metres, NaN where unknown."""
    columns, rows = points.pixels.T
    return np.asarray((depth_m * ray_lengths(camera))[rows, columns], dtype=np.float64)
