"""What stands on the carpet and where it ends, bearing by bearing from below the camera."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uav_bt.classes import GROUP_BACKGROUND, GROUP_CARPET, GROUP_OBSTACLE
from uav_bt.errors import ValueRangeError
from uav_bt.types import CameraModel
from uav_bt.types.projection import project

_OUTSIDE = 255  # no group: what lies below the image


@dataclass(frozen=True, kw_only=True)
class ContactScanConfig:
    """How finely the view is scanned.

    It is scanned along bearings, not along columns: away from the image's centre a vertical edge
    leans, and the lowest obstacle pixel of a column may lie half-way up a box.
    """

    bearing_step_rad: float = math.radians(1.0)  # about three columns of a 224-wide map
    elevation_step_rad: float = math.radians(0.5)  # about a row of it
    max_elevation_rad: float = math.radians(-8.0)  # carpet seen flatter is beyond the lab
    min_run: int = 4  # samples of obstacle or background above a base; fewer are specks

    def __post_init__(self) -> None:
        steps = min(self.bearing_step_rad, self.elevation_step_rad)
        if not steps > 0.0 or self.min_run < 1 or not self.max_elevation_rad < 0.0:
            raise ValueRangeError(f"a scan needs positive steps below the horizon, got {self}")


@dataclass(frozen=True)
class Bases:
    """Where the carpet meets obstacles and where it ends, from the point below the camera."""

    placed_m: NDArray[np.float64]  # (N, 2) forward, right
    # (M, 2): the nearest carpet in view on bearings where an obstacle hides it: the obstacle stands
    # somewhere before it, since a vertical edge keeps its bearing.
    hidden_m: NDArray[np.float64]
    edges_m: NDArray[np.float64]  # (K, 2): where background follows the carpet
    hidden_edges_m: NDArray[np.float64]  # (L, 2): the nearest in view, where it is background


def find_bases(
    groups: NDArray[np.uint8],
    camera: CameraModel,
    gimbal_pitch_rad: float,
    height_m: float,
    config: ContactScanConfig | None = None,
) -> Bases:
    """Scan a group map along bearings for the first obstacle on the carpet, and for its edge.

    Args:
        groups: (H, W) group ids.
        camera: intrinsics at that size.
        gimbal_pitch_rad: when the frame was captured.
        height_m: of the camera above the carpet.
        config: how finely it is scanned.
    """
    config = config or ContactScanConfig()
    height_px, width_px = groups.shape
    half_view = math.atan2(width_px / 2, camera.fx_px)
    lowest = gimbal_pitch_rad - math.atan2(height_px / 2, camera.fy_px)
    # At the lower edge the same columns span wider bearings than at the image's centre.
    widest = math.atan(math.tan(half_view) / max(math.cos(lowest), 0.2))
    bearings = np.arange(-widest, widest, config.bearing_step_rad)
    end = min(config.max_elevation_rad, gimbal_pitch_rad + 0.6)
    elevations = np.arange(lowest, end, config.elevation_step_rad)
    ranges = max(height_m, 0.05) / np.tan(-elevations)
    ground = np.empty((bearings.size, elevations.size, 3))
    ground[..., 0] = np.cos(bearings)[:, None] * ranges
    ground[..., 1] = np.sin(bearings)[:, None] * ranges
    ground[..., 2] = max(height_m, 0.05)
    pixels = np.rint(project(ground, camera, gimbal_pitch_rad))
    columns, rows = pixels[..., 0], pixels[..., 1]
    inside = (columns >= 0) & (columns < width_px) & (rows >= 0) & (rows < height_px)
    sampled = np.where(
        inside,
        groups[
            np.clip(rows, 0, height_px - 1).astype(int),
            np.clip(columns, 0, width_px - 1).astype(int),
        ],
        _OUTSIDE,
    )
    rows, first, before = _first_runs(sampled, GROUP_OBSTACLE, config.min_run)
    stands, hides = before == GROUP_CARPET, before == _OUTSIDE
    edge_rows, edge, before = _first_runs(sampled, GROUP_BACKGROUND, config.min_run)
    ends, ended = before == GROUP_CARPET, before == _OUTSIDE
    level = ground[..., :2]
    return Bases(
        placed_m=level[rows[stands], first[stands]],
        hidden_m=level[rows[hides], first[hides]],
        edges_m=level[edge_rows[ends], edge[ends]],
        hidden_edges_m=level[edge_rows[ended], edge[ended]],
    )


def _first_runs(
    sampled: NDArray[np.uint8], group: int, min_run: int
) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.uint8]]:
    """Find the nearest run of a group on each bearing; samples go from near to far.

    Returns:
        The bearings that have one, where it begins, and the group before it.
    """
    solid = sampled == group
    samples = solid.copy()
    for shift in range(1, min_run):
        solid[:, :-shift] &= samples[:, shift:]
        solid[:, -shift:] = False
    rows = np.flatnonzero(solid.any(axis=1))
    first = solid[rows].argmax(axis=1)
    before = np.where(first > 0, sampled[rows, np.maximum(first - 1, 0)], _OUTSIDE)
    return rows, first, before
