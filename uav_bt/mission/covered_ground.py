"""Share of the free ground that a flight has passed and seen, by the truth.

A cell of 5 cm is *passed* once the body's centre came within 0.5 m of its middle, seen from above,
and *seen* once its middle was in the camera's view, within 3 m of the lens and not hidden by an
object on the ground. Ground without an object on it is free. A table covers the ground below its
legs only, and hides the ground behind its top.
"""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np

from uav_bt.mission.flight_report import EXPLORE_S
from uav_bt.types import CameraModel, Pose, Truth, projection
from uav_bt.types.arrays import Flags, Floats
from uav_bt.types.ground import Block, Footprint, Ground

CELL_M: Final = 0.05
PASSED_M: Final = 0.5  # from the flown path to a cell's middle
SEEN_M: Final = 3.0  # from the lens to a cell's middle
CURVE_S: Final = 10.0  # between the points of a flight's curve
_LOOK_S: Final = 0.2  # between two looks at the view
_SLACK_S: Final = 1e-6
_LOW_M: Final = 0.3  # a part whose underside is lower leaves no free ground below it; chosen


class GroundCells:
    """The ground as cells: rows along y upwards, columns along x; world metres."""

    def __init__(self, ground: Ground) -> None:
        self.x_m, self.y_m = (_middles(side) for side in ground.size_m)  # of columns, of rows
        self.middles_m = np.stack(np.meshgrid(self.x_m, self.y_m), axis=-1)  # (rows, columns, 2)
        # Without an object on them, (rows, columns).
        self.free: Flags = np.ones(self.middles_m.shape[:2], dtype=np.bool_)
        if ground.outline_m:
            self.free &= _inside(ground, self.middles_m)
        for block in (each for item in ground.standing for each in item.blocks):
            if block.base_m < _LOW_M:
                self.free &= ~_under(block.footprint, self.middles_m)

    def share(self, cells: Flags) -> float:
        """Return the share of the free ground that cells cover, 0 to 1; 0 without free ground."""
        free = int(self.free.sum())
        return float((cells & self.free).sum()) / free if free else 0.0

    def mark_passed(self, cells: Flags, x_m: float, y_m: float) -> None:
        """Mark the cells around a place of the body's centre."""
        rows, columns = self.window(x_m, y_m, PASSED_M)
        away_m2 = (self.x_m[columns] - x_m) ** 2 + ((self.y_m[rows] - y_m) ** 2)[:, None]
        cells[rows, columns] |= away_m2 <= PASSED_M**2

    def window(self, x_m: float, y_m: float, reach_m: float) -> tuple[slice, slice]:
        """Return the rows and columns whose middles may lie within a reach of a world point."""
        (first_x, last_x), (first_y, last_y) = (
            np.searchsorted(middles, (at - reach_m, at + reach_m))
            for middles, at in ((self.x_m, x_m), (self.y_m, y_m))
        )
        return slice(first_y, last_y), slice(first_x, last_x)


class CoveredGround:
    """Follows a flight and measures its coverage of the ground; ignores the lens's distortion."""

    def __init__(self, ground: Ground, camera: CameraModel) -> None:
        self._cells = GroundCells(ground)
        self._blocks = [block for item in ground.standing for block in item.blocks]
        self._camera = camera
        self._passed = np.zeros_like(self._cells.free)
        self._unseen = self._cells.free.copy()
        self._next_look_s = 0.0
        self.curve: list[list[float]] = []  # time from the take-off command, passed, seen

    @property
    def seen(self) -> Flags:
        """The free cells that have been seen, (rows, columns)."""
        return self._cells.free & ~self._unseen

    def shares(self) -> tuple[float, float]:
        """Return the passed and the seen share of the free ground until now, 0 to 1."""
        return self._cells.share(self._passed), self._cells.share(self.seen)

    def fields(self) -> dict[str, Any]:
        """Return the fields of the flight's report."""
        passed, seen = self.shares()
        early = next((row for row in self.curve if row[0] == EXPLORE_S), (None, None, None))
        return {
            "coverage_passed_90s": early[1],
            "coverage_passed": round(passed, 4),
            "coverage_seen_90s": early[2],
            "coverage_seen": round(seen, 4),
            "coverage_curve": self.curve,
        }

    def add(self, time_s: float, truth: Truth) -> None:
        """Add the truth of a tick, at a time from the take-off command."""
        self._cells.mark_passed(self._passed, truth.pose.x_m, truth.pose.y_m)
        if truth.gimbal_pitch_rad is not None and time_s >= self._next_look_s - _SLACK_S:
            self._next_look_s = time_s + _LOOK_S
            self._look(truth.pose, truth.gimbal_pitch_rad)
        due_s = CURVE_S * (len(self.curve) + 1)
        while time_s >= due_s - _SLACK_S:
            self.curve.append([due_s, *(round(share, 4) for share in self.shares())])
            due_s += CURVE_S

    def _look(self, body: Pose, pitch_rad: float) -> None:
        """Mark the cells that are in view."""
        if not 0.0 < body.z_m < SEEN_M:
            return
        x_m, y_m = body.to_world(self._camera.forward_offset_m, 0.0)
        lens = Pose(x_m=x_m, y_m=y_m, z_m=body.z_m, yaw_rad=body.yaw_rad)
        window = self._cells.window(x_m, y_m, math.sqrt(SEEN_M**2 - body.z_m**2))
        unseen = self._unseen[window]
        rows, columns = np.nonzero(unseen)
        middles_m = self._cells.middles_m[window][rows, columns]
        seen = np.flatnonzero(self._in_view(lens, pitch_rad, middles_m))
        for block in self._blocks:
            seen = seen[~_hidden(lens, block, middles_m[seen])]
        unseen[rows[seen], columns[seen]] = False

    def _in_view(self, lens: Pose, pitch_rad: float, points_m: Floats) -> Flags:
        """Return which ground points, (N, 2), lie in the image and within reach."""
        ahead_m, left_m = lens.points_to_body(points_m).T
        level = np.stack([ahead_m, -left_m, np.full_like(ahead_m, lens.z_m)], axis=-1)
        pixels = projection.project(level, self._camera, pitch_rad)
        column, row = pixels[:, 0], pixels[:, 1]  # NaN behind the camera, in no bounds
        inside = (column >= -0.5) & (column <= self._camera.width_px - 0.5)
        inside &= (row >= -0.5) & (row <= self._camera.height_px - 0.5)
        return np.asarray(inside & (ahead_m**2 + left_m**2 <= SEEN_M**2 - lens.z_m**2))


def _middles(side_m: float) -> Floats:
    count = max(1, round(side_m / CELL_M))
    return np.asarray((np.arange(count) + 0.5) * side_m / count - side_m / 2)


def _under(box: Footprint, points_m: Floats) -> Flags:
    """Return which world points, (..., 2), lie below an outline."""
    u, v = np.moveaxis(box.points_to_body(points_m), -1, 0)
    if box.round:
        return np.asarray(u**2 + v**2 <= box.half_x_m**2)
    return np.asarray((np.abs(u) <= box.half_x_m) & (np.abs(v) <= box.half_y_m))


def _inside(ground: Ground, points_m: Floats) -> Flags:
    """Return which world points lie in the ground's polygon: a ray crosses its sides oddly."""
    x_m, y_m = points_m[..., 0], points_m[..., 1]
    inside = np.zeros(x_m.shape, dtype=np.bool_)
    for ax, ay, ex, ey in ground.area.edges[0]:
        if ey != 0.0:
            inside ^= ((ay > y_m) != (ay + ey > y_m)) & (x_m < ax + (y_m - ay) / ey * ex)
    return inside


def _hidden(lens: Pose, block: Block, points_m: Floats) -> Flags:
    """Return which ground points, (N, 2), a part of an object hides from the lens.

    A line of sight goes from 0 at the lens to 1 on the ground. It meets the part where it is
    between the part's base and top, and over the part's outline (slab method).
    """
    box = block.footprint
    enters = np.full(len(points_m), max(0.0, 1.0 - block.top_m / lens.z_m))
    leaves = np.full(len(points_m), 1.0 - block.base_m / lens.z_m)
    starts, ends = box.to_body(lens.x_m, lens.y_m), box.points_to_body(points_m).T
    if box.round:
        (u, v), (du, dv) = starts, (end - start for start, end in zip(starts, ends, strict=True))
        square = np.maximum(du**2 + dv**2, 1e-12)
        along = -(u * du + v * dv) / square
        root = np.sqrt(np.maximum(along**2 - (u**2 + v**2 - box.half_x_m**2) / square, 0.0))
        return np.asarray(np.maximum(enters, along - root) < np.minimum(leaves, along + root))
    for start, end, half in zip(starts, ends, (box.half_x_m, box.half_y_m), strict=True):
        along = end - start
        along = np.where(np.abs(along) < 1e-12, 1e-12, along)  # parallel to the faces
        one, other = (-half - start) / along, (half - start) / along
        enters = np.maximum(enters, np.minimum(one, other))
        leaves = np.minimum(leaves, np.maximum(one, other))
    return np.asarray(enters < leaves)
