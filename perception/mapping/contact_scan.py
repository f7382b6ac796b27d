"""Scan of a class map for bases of obstacles and the ground's edge, by bearing.

The scan follows bearings, not columns: away from the image's centre a vertical edge leans, and the
lowest obstacle pixel of a column may lie half-way up a box.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Final, Self

import numpy as np

from perception.mapping.legs import Covered, cover_below
from uav_bt.compiled import compiled
from uav_bt.lab.classes import GROUND, NO_ROLE, OBSTACLE, OUTSIDE
from uav_bt.types import CameraModel, ClassMap, Frame
from uav_bt.types.arrays import Flags, Floats, Ids, Indices
from uav_bt.types.projection import camera_axes

MIN_HEIGHT_M: Final = 0.05  # chosen; lower heights are raised to this to avoid division by zero
_BEARING_STEP_RAD: Final = math.radians(1.0)  # about three columns of a 224-wide map
_ELEVATION_STEP_RAD: Final = math.radians(0.5)  # about one row of a 224-wide map
_MAX_ELEVATION_RAD: Final = math.radians(-8.0)  # ground above this elevation is beyond the lab
_MIN_RUN: Final = 4  # samples of obstacle or background above a base; fewer are mask noise
# An obstacle is tall from this height on, and where it ends this near below the camera. Chosen.
_TALL_M: Final = 0.9
_BELOW_M: Final = 0.5
_HIDDEN_M: Final = 1.0  # assumed range of a base below the image
_TALL_SHARE: Final = 0.9  # of the samples that it covers; the others are mask noise


@dataclass(frozen=True, eq=False)
class GroundScan:
    """A class map sampled at points of the ground along bearings."""

    level_m: Floats  # (B, E, 2) forward, right of the point below the camera
    ids: Ids  # (B, E) class ids; `NO_ROLE` for samples below the image
    roles: Ids  # (B, E) role ids; `NO_ROLE` for samples below the image
    height_m: float  # of the camera above the ground
    min_run: int = _MIN_RUN
    covered: Covered | None = None  # ground below boards of objects on legs
    # (C,) whether a class, or the one below it, is of objects on legs
    on_legs: Flags = field(default_factory=lambda: np.zeros(256, dtype=bool))


@dataclass(frozen=True, kw_only=True, eq=False)
class PointTable:
    """N points of a level plane; subclasses add columns."""

    xy_m: Floats  # (N, 2)

    def __len__(self) -> int:
        return len(self.xy_m)

    def take(self, which: Flags | Indices) -> Self:
        """Return the rows of (N,) flags, or of row numbers."""
        if which.dtype == np.bool_ and which.all():
            return self  # callers never write to columns
        rows = np.flatnonzero(which) if which.dtype == np.bool_ else which
        columns = vars(self).items()
        return type(self)(**{name: column.take(rows, axis=0) for name, column in columns})

    def with_rows(self, other: Self) -> Self:
        """Return this table with another's rows below."""
        mine, theirs = vars(self), vars(other)
        return type(self)(**{name: np.concatenate([mine[name], theirs[name]]) for name in mine})


@dataclass(frozen=True, kw_only=True, eq=False)
class Placed(PointTable):
    """Bases of obstacles, forward and right of the point below the camera."""

    ids: Ids  # (N,) classes of the obstacles there
    tall: Flags  # (N,) whether they are tall


@dataclass(frozen=True)
class Bases:
    """Bases of obstacles and edges of the ground, from the point below the camera."""

    placed: Placed
    # (M, 2): the nearest sample in view on bearings where it shows an obstacle. The obstacle stands
    # there or nearer, since a vertical edge keeps its bearing.
    hidden_m: Floats
    # whether that obstacle reaches the drone's height; no object on legs, below which ground shows
    hidden_tall: Flags
    edges_m: Floats  # (K, 2): borders of ground and background behind it
    hidden_edges_m: Floats  # (L, 2): nearest samples in view that are background


def scan_ground(class_map: ClassMap, frame: Frame, camera: CameraModel) -> GroundScan:
    """Sample a class map along bearings, each from near to far; the camera is at its size."""
    pitch_rad, height_m = frame.gimbal_pitch_rad, max(frame.height_above_ground_m, MIN_HEIGHT_M)
    height_px, width_px = class_map.ids.shape
    half_view = math.atan2(width_px / 2, camera.fx_px)
    lowest = pitch_rad - math.atan2(height_px / 2, camera.fy_px)
    lowest = max(lowest, -math.pi / 2 + _ELEVATION_STEP_RAD)  # lower is behind the camera
    # At the lower edge the same columns span wider bearings than at the image's centre.
    widest = math.atan(math.tan(half_view) / max(math.cos(lowest), 0.2))
    bearings = np.arange(-widest, widest, _BEARING_STEP_RAD)
    elevations = np.arange(lowest, min(_MAX_ELEVATION_RAD, pitch_rad + 0.6), _ELEVATION_STEP_RAD)
    ranges_m = height_m / np.tan(-elevations)
    directions = np.cos(bearings), np.sin(bearings)
    level_m = np.stack([np.outer(each, ranges_m) for each in directions], axis=-1)
    pixels = ground_pixels(
        level_m.reshape(-1, 2),
        height_m,
        camera_axes(pitch_rad),
        camera.pinhole_px,
        class_map.ids.shape,
        True,
    ).reshape(level_m.shape[:2])
    inside = pixels >= 0
    ids = np.where(inside, class_map.ids.take(pixels), np.uint8(NO_ROLE))
    roles = np.where(inside, class_map.roles.take(pixels), np.uint8(NO_ROLE))
    classes, covered = class_map.classes, None
    on_legs = classes.legs_m > 0.0
    on_legs[classes.top_of[on_legs]] = True
    on_legs[0] = False  # the background, which is the top of classes without one
    if on_legs.any():
        runs = first_runs(roles, OBSTACLE, _MIN_RUN)
        covered = cover_below(level_m, ids, roles, classes, runs)
    return GroundScan(level_m, ids, roles, height_m, covered=covered, on_legs=on_legs)


def find_bases(scan: GroundScan) -> Bases:
    """Find the first obstacle on the ground on each bearing of a scan, and the ground's edge."""
    rows, first, before = first_runs(scan.roles, OBSTACLE, scan.min_run)
    stands, hides = before == GROUND, before == NO_ROLE
    edge_rows, edge, edge_before = first_runs(scan.roles, OUTSIDE, scan.min_run)
    ends, ended = edge_before == GROUND, edge_before == NO_ROLE
    placed, hidden = (rows[stands], first[stands]), (rows[hides], first[hides])
    placed_m, gap_m = _borders_m(scan, *placed), max(_BELOW_M, scan.height_m - _TALL_M)
    bases_m = np.hypot(*placed_m.T)[:, None]
    hidden_tall = _are_tall(scan, hidden[0], 0.0, _HIDDEN_M * scan.height_m / _BELOW_M)
    return Bases(
        placed=Placed(
            xy_m=placed_m,
            ids=scan.ids[placed],
            tall=_are_tall(scan, placed[0], bases_m, bases_m * scan.height_m / gap_m),
        ),
        hidden_m=scan.level_m[hidden],
        hidden_tall=hidden_tall & ~scan.on_legs[scan.ids[hidden]],
        edges_m=_borders_m(scan, edge_rows[ends], edge[ends]),
        hidden_edges_m=scan.level_m[edge_rows[ended], edge[ended]],
    )


def _are_tall(
    scan: GroundScan, rows: Indices, from_m: Floats | float, to_m: Floats | float
) -> Flags:
    """Return whether obstacles cover N bearings between two ranges, (N, 1) each or one for all."""
    ranges_m = np.hypot(*np.moveaxis(scan.level_m[rows], -1, 0))
    shown = (ranges_m > from_m) & (ranges_m <= to_m)
    shown &= scan.roles[rows] != NO_ROLE
    covered = shown & (scan.roles[rows] == OBSTACLE)
    return np.asarray(covered.sum(axis=1) >= _TALL_SHARE * shown.sum(axis=1))


def _borders_m(scan: GroundScan, rows: Indices, first: Indices) -> Floats:
    """Return the beginnings of runs: half-way between their first samples and those before."""
    return np.asarray((scan.level_m[rows, first] + scan.level_m[rows, first - 1]) / 2)


@compiled(
    "intp[::1](float64[:, ::1], float64, float64[:, ::1], UniTuple(float64, 4), UniTuple(int64, 2),"
    " boolean)"
)
def ground_pixels(  # noqa: PLR0917 - Numba passes arguments by position
    points_m: Floats,
    height_m: float,
    axes: Floats,
    pinhole_px: tuple[float, float, float, float],
    shape: tuple[int, int],
    rounds: bool,  # noqa: FBT001
) -> Indices:
    """Return the flat indices of the pixels nearest to points of the ground, (N, 2), or -1.

    -1 is for points behind the camera or outside the image: beyond its outermost pixels' middles,
    or `rounds` up to half a pixel further. The pixels are those of `project`, but the order of the
    sums is the same on all processors.
    """
    fx, fy, cx, cy = pinhole_px
    pixels = np.full(len(points_m), -1)
    for point in range(len(points_m)):
        forward_m, right_m = points_m[point, 0], points_m[point, 1]
        depth = forward_m * axes[0, 2] + right_m * axes[1, 2] + height_m * axes[2, 2]
        if not depth > 1e-9:
            continue
        x = forward_m * axes[0, 0] + right_m * axes[1, 0] + height_m * axes[2, 0]
        y = forward_m * axes[0, 1] + right_m * axes[1, 1] + height_m * axes[2, 1]
        column, row = fx * x / depth + cx, fy * y / depth + cy
        near_column, near_row = np.rint(column), np.rint(row)
        if rounds:
            column, row = near_column, near_row
        if 0 <= column <= shape[1] - 1 and 0 <= row <= shape[0] - 1:
            pixels[point] = int(near_row) * shape[1] + int(near_column)
    return pixels


@compiled("Tuple((intp[::1], intp[::1], uint8[::1]))(uint8[:, ::1], int64, int64)")
def first_runs(sampled: Ids, role: int, min_run: int) -> tuple[Indices, Indices, Ids]:
    """Find the nearest run of a role on each bearing of (B, E) role ids.

    Return the bearings with a run, the index of its first sample, and the role before it.
    """
    rows, first = np.empty(len(sampled), dtype=np.intp), np.empty(len(sampled), dtype=np.intp)
    before = np.full(len(sampled), np.uint8(NO_ROLE))
    found = 0
    for bearing in range(len(sampled)):
        run = 0
        for sample in range(sampled.shape[1]):
            run = run + 1 if sampled[bearing, sample] == role else 0
            if run == min_run:
                rows[found], first[found] = bearing, sample + 1 - run
                if run <= sample:
                    before[found] = sampled[bearing, sample - run]
                found += 1
                break
    return rows[:found], first[:found], before[:found]
