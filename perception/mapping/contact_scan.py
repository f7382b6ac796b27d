"""Scan of a class map for bases of obstacles and the ground's edge, by bearing."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from perception.mapping import scan_loops
from perception.mapping.legs import Covered, cover_below
from uav_bt.errors import ValueRangeError
from uav_bt.lab.classes import GROUND, NO_ROLE, OBSTACLE, OUTSIDE
from uav_bt.types import CameraModel, ClassMap, Frame
from uav_bt.types.projection import camera_axes


@dataclass(frozen=True, kw_only=True)
class ContactScanConfig:
    """Resolution of the scan.

    The scan follows bearings, not columns: away from the image's centre a vertical edge leans, and
    the lowest obstacle pixel of a column may lie half-way up a box.
    """

    bearing_step_rad: float = math.radians(1.0)  # about three columns of a 224-wide map
    elevation_step_rad: float = math.radians(0.5)  # about one row of a 224-wide map
    max_elevation_rad: float = math.radians(-8.0)  # ground above this elevation is beyond the lab
    min_run: int = 4  # samples of obstacle or background above a base; fewer are mask noise
    # An obstacle at a metre that covers a bearing up to this elevation reaches the drone's height.
    tall_rad: float = math.radians(-25.0)
    tall_share: float = 0.9  # of the samples that it covers; the others are mask noise

    def __post_init__(self) -> None:
        steps = min(self.bearing_step_rad, self.elevation_step_rad)
        if not steps > 0.0 or self.min_run < 1 or not self.max_elevation_rad < 0.0:
            raise ValueRangeError(f"a scan needs positive steps below the horizon, got {self}")


@dataclass(frozen=True, eq=False)
class GroundScan:
    """A class map sampled at points of the ground along bearings."""

    level_m: NDArray[np.float64]  # (B, E, 2) forward, right of the point below the camera
    ids: NDArray[np.uint8]  # (B, E) class ids; `NO_ROLE` for samples below the image
    roles: NDArray[np.uint8]  # (B, E) role ids; `NO_ROLE` for samples below the image
    image_roles: NDArray[np.uint8]  # (H, W) role ids of the whole class map
    top_of: NDArray[np.uint8]  # (C,) class of the upper face of each class; 0 without one
    height_m: float  # of the camera above the ground
    config: ContactScanConfig
    covered: Covered | None = None  # ground below boards of objects on legs
    # (C,) whether a class, or the one below it, is of objects on legs
    on_legs: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(256, dtype=bool))


@dataclass(frozen=True)
class Bases:
    """Bases of obstacles and edges of the ground, from the point below the camera."""

    placed_m: NDArray[np.float64]  # (N, 2) forward, right
    placed_ids: NDArray[np.uint8]  # (N,) classes of the obstacles there
    # (N,) heights of their upper edges above the ground, m; NaN where the roof is not in view
    placed_heights_m: NDArray[np.float64]
    # (M, 2): the nearest sample in view on bearings where it shows an obstacle. The obstacle stands
    # there or nearer, since a vertical edge keeps its bearing.
    hidden_m: NDArray[np.float64]
    # whether that obstacle reaches the drone's height; no object on legs, below which ground shows
    hidden_tall: NDArray[np.bool_]
    edges_m: NDArray[np.float64]  # (K, 2): borders of ground and background behind it
    hidden_edges_m: NDArray[np.float64]  # (L, 2): nearest samples in view that are background


def scan_ground(
    class_map: ClassMap, frame: Frame, camera: CameraModel, config: ContactScanConfig | None = None
) -> GroundScan:
    """Sample a class map along bearings, each from near to far.

    Args:
        class_map: class map of `frame`.
        frame: its gimbal pitch and height place the samples on the ground.
        camera: intrinsics at the class map's size.
        config: resolution of the scan.
    """
    config = config or ContactScanConfig()
    pitch_rad, height_m = frame.gimbal_pitch_rad, max(frame.height_above_ground_m, 0.05)
    height_px, width_px = class_map.ids.shape
    half_view = math.atan2(width_px / 2, camera.fx_px)
    lowest = pitch_rad - math.atan2(height_px / 2, camera.fy_px)
    lowest = max(lowest, -math.pi / 2 + config.elevation_step_rad)  # lower is behind the camera
    # At the lower edge the same columns span wider bearings than at the image's centre.
    widest = math.atan(math.tan(half_view) / max(math.cos(lowest), 0.2))
    bearings = np.arange(-widest, widest, config.bearing_step_rad)
    end = min(config.max_elevation_rad, pitch_rad + 0.6)
    elevations = np.arange(lowest, end, config.elevation_step_rad)
    image_roles = class_map.roles
    level_m, ids, roles = scan_loops.sampled(
        np.ascontiguousarray(class_map.ids),
        image_roles,
        np.column_stack([np.cos(bearings), np.sin(bearings)]),
        height_m / np.tan(-elevations),
        height_m,
        camera_axes(pitch_rad),
        camera.pinhole_px,
    )
    classes, covered = class_map.classes, None
    on_legs = classes.legs_m > 0.0
    on_legs[classes.top_of[on_legs]] = True
    on_legs[0] = False  # the background, which is the top of classes without one
    if on_legs.any():
        covered = cover_below(level_m, ids, roles, classes, config.min_run)
    return GroundScan(
        level_m, ids, roles, image_roles, classes.top_of, height_m, config, covered, on_legs
    )


def find_bases(scan: GroundScan) -> Bases:
    """Find the first obstacle on the ground on each bearing of a scan, and the ground's edge."""
    min_run = scan.config.min_run
    rows, first, before = scan_loops.first_runs(scan.roles, OBSTACLE, min_run)
    stands, hides = before == GROUND, before == NO_ROLE
    edge_rows, edge, edge_before = scan_loops.first_runs(scan.roles, OUTSIDE, min_run)
    ends, ended = edge_before == GROUND, edge_before == NO_ROLE
    placed = rows[stands], first[stands]
    return Bases(
        placed_m=_borders_m(scan, *placed),
        placed_ids=scan.ids[placed],
        placed_heights_m=scan_loops.upper_edges(
            scan.level_m, scan.ids, *placed, scan.top_of, scan.height_m
        ),
        hidden_m=scan.level_m[rows[hides], first[hides]],
        hidden_tall=_are_tall(scan, rows[hides])
        & ~scan.on_legs[scan.ids[rows[hides], first[hides]]],
        edges_m=_borders_m(scan, edge_rows[ends], edge[ends]),
        hidden_edges_m=scan.level_m[edge_rows[ended], edge[ended]],
    )


def _are_tall(scan: GroundScan, rows: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Return whether obstacles cover bearings up to the elevation of the drone's height."""
    ranges_m = np.hypot(*np.moveaxis(scan.level_m[rows], -1, 0))
    below = ranges_m <= scan.height_m / math.tan(-scan.config.tall_rad)
    shown = below & (scan.roles[rows] != NO_ROLE)
    covered = shown & (scan.roles[rows] == OBSTACLE)
    return np.asarray(covered.sum(axis=1) >= scan.config.tall_share * shown.sum(axis=1))


def _borders_m(
    scan: GroundScan, rows: NDArray[np.intp], first: NDArray[np.intp]
) -> NDArray[np.float64]:
    """Return the beginnings of runs: half-way between their first samples and those before."""
    return np.asarray((scan.level_m[rows, first] + scan.level_m[rows, first - 1]) / 2)
