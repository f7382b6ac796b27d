"""How far ahead the way to a target is free, from masks and the camera's geometry alone.

A box stands on the carpet, so the lowest obstacle pixel of a column sees its base, and the ray
through that pixel meets the carpet there. A column that is obstacle down to the image's lower edge
belongs to a box nearer than the nearest visible carpet; its range is unknown, so it counts as in the
way when its bearing could put it there.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from perception.classes import GROUP_OBSTACLE, group_of
from perception.geometry import ground_points
from uav_bt.types import CameraModel, ClassMap

__all__ = ["PathCheckConfig", "free_path"]


@dataclass(frozen=True, kw_only=True)
class PathCheckConfig:
    """The swept path that must be free."""

    half_width_m: float = 0.40  # half the body's width, 0.16, and a margin for drift and masks
    # Obstacles without a visible base count within this bearing: at the nearest range where a base
    # shows, about 1.3 m, the half width subtends as much.
    near_bearing_rad: float = math.radians(19)
    min_run_px: int = 3  # columns; fewer are specks of the mask


def free_path(
    class_map: ClassMap,
    camera: CameraModel,
    gimbal_pitch_rad: float,
    height_m: float,
    config: PathCheckConfig | None = None,
) -> float:
    """Return the free distance straight ahead of the camera, metres; inf when nothing is in view.

    Args:
        class_map: of a forward-looking frame.
        camera: intrinsics at the class map's size.
        gimbal_pitch_rad: when the frame was captured.
        height_m: of the camera above the carpet.
        config: the path's width and tolerances.
    """
    cfg = config or PathCheckConfig()
    obstacle = group_of(class_map.ids) == GROUP_OBSTACLE
    columns = np.flatnonzero(obstacle.any(axis=0))
    if columns.size < cfg.min_run_px:
        return math.inf
    last_row = obstacle.shape[0] - 1
    lowest = last_row - obstacle[::-1, columns].argmax(axis=0)
    bases = ground_points(
        np.stack([columns, lowest], axis=-1), camera, gimbal_pitch_rad, max(height_m, 0.05)
    )
    forward, right = bases[:, 0], bases[:, 1]
    bearing = np.arctan2(columns - camera.cx_px, camera.fx_px)
    hidden_base = lowest >= last_row - 1
    in_path = np.where(
        hidden_base,
        np.abs(bearing) < cfg.near_bearing_rad,
        np.abs(right) < cfg.half_width_m,
    )
    ranges = np.sort(np.where(hidden_base, 0.0, forward)[in_path & ~np.isnan(forward)])
    # The few nearest columns may be specks: the distance is that of the `min_run_px`-th.
    return float(ranges[cfg.min_run_px - 1]) if ranges.size >= cfg.min_run_px else math.inf
