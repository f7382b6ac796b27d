"""The map's grid: seen ground, its end, and cells passed by the drone."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from perception.mapping.view import View
from uav_bt.compiled import compiled
from uav_bt.errors import ValueRangeError
from uav_bt.lab.classes import GROUND, MARK, NO_ROLE, OUTSIDE
from uav_bt.types.arrays import Flags, Floats, Indices
from uav_bt.types.site_map import is_beyond_edge


@dataclass(frozen=True, kw_only=True)
class GroundGridConfig:
    """Size of the grid, and limits of its entries."""

    cell_m: float = 0.1  # side of a cell; chosen
    reach_m: float = 12.0  # from the take-off point in each direction; chosen
    max_range_m: float = 4.0  # ground further from the camera is seen at too flat an angle; chosen
    # Views vote whether a cell is ground or beyond its end; votes are limited to this. Chosen.
    max_votes: int = 6
    near_step_m: float = 0.08  # step along cleared bearings; chosen smaller than a cell
    near_bearings: int = 3  # every n-th bearing of the scan is cleared; chosen
    passed_m: float = 0.5  # cells this near to the flown path were passed; as `coverage_passed`
    around_m: float = 0.1  # ground must be seen this far around a place, its error at range; chosen
    lane_s: float = 90.0  # a mover may return to a former place within this time; chosen
    looked_s: float = 0.4  # ground seen within this time is free of movers; chosen
    lane_m: float = 0.2  # radius of a lane around a mover's path; chosen
    body_m: float = 0.35  # cells this near to the drone are free; chosen

    def __post_init__(self) -> None:
        if not 0.0 < self.cell_m < self.reach_m:
            raise ValueRangeError(f"a cell must be smaller than the grid, got {self}")


class GroundGrid:
    """Cells around the take-off point, rows along x, columns along y of the map's frame."""

    def __init__(self, config: GroundGridConfig | None = None) -> None:
        self.config = config = config or GroundGridConfig()
        side = 2 * round(config.reach_m / config.cell_m) + 1
        self.seen_s = np.full((side, side), -np.inf)  # float64: clocks may count from 1970
        self.free = np.zeros((side, side), dtype=bool)
        self.passed = np.zeros((side, side), dtype=bool)
        self._beyond = np.zeros((side, side), dtype=np.int8)  # votes: positive lies beyond the edge
        self._disc = _disc(config.passed_m / config.cell_m)
        self._around = np.argwhere(_disc(config.around_m / config.cell_m))
        self._around -= self._around.max(axis=0) // 2
        self._moved_s = np.full((side, side), -np.inf)  # last time of a mover there
        self._has_moved = False
        self._lane = np.argwhere(_disc(config.lane_m / config.cell_m))
        self._lane -= self._lane.max(axis=0) // 2
        self._body = _disc(config.body_m / config.cell_m)
        self._low, self._high = np.full(2, side // 2), np.full(2, side // 2)  # cells in use
        self.full = False  # something lay outside the grid

    def add(self, view: View) -> None:
        """Add the ground in a view.

        Args:
            view: placed in the map's frame.
        """
        cfg, scan, lens = self.config, view.scan, view.lens
        lens_at = (lens.x_m, lens.y_m, math.cos(lens.yaw_rad), math.sin(lens.yaw_rad))
        used, outside = _vote(
            scan.level_m,
            scan.roles,
            lens_at,
            (view.captured_s, cfg.max_range_m, cfg.cell_m),
            cfg.max_votes,
            self._beyond,
            self.seen_s,
            self.free,
        )
        self.full |= outside
        if used[0, 0] <= used[1, 0]:
            self._use(used)
        _clear_below(
            scan.level_m,
            scan.roles,
            lens_at,
            (cfg.near_step_m, cfg.max_range_m, cfg.cell_m),
            cfg.near_bearings,
            self.free,
        )

    def fly_over(self, x_m: float, y_m: float) -> None:
        """Mark the cells below the drone as passed and free of obstacles."""
        row, column = self._cells(np.array([[x_m, y_m]]))[0]
        _stamp(self.passed, int(row), int(column), self._disc)
        _stamp(self.free, int(row), int(column), self._body)
        inside = 0 <= row < self.seen_s.shape[0] and 0 <= column < self.seen_s.shape[0]
        self.full |= not inside
        if inside:
            self._use(np.array([[row, column]]))

    def was_ground(self, places_m: Floats) -> Flags:
        """Return the places with all ground around them seen, (N,).

        Args:
            places_m: (N, 2) in the map's frame.
        """
        cells = self._cells(places_m)[:, None, :] + self._around
        inside = ((cells >= 0) & (cells < self.seen_s.shape[0])).all(axis=(1, 2))
        known = np.zeros(len(places_m), dtype=bool)
        rows, columns = np.moveaxis(cells[inside], -1, 0)
        known[inside] = np.isfinite(self.seen_s[rows, columns]).all(axis=1)
        return known

    def shows_ground(self, x_m: float, y_m: float, *, since_s: float) -> bool:
        """Return whether all ground around a place was seen after `since_s`."""
        cells = self._cells(np.array([[x_m, y_m]])) + self._around
        inside = ((cells >= 0) & (cells < self.seen_s.shape[0])).all()
        return bool(inside and (self.seen_s[tuple(cells.T)] > since_s).all())

    def shown_at(self, places_m: Floats, captured_s: float) -> Flags:
        """Return the places at which the newest view showed ground, (N,).

        Args:
            places_m: (N, 2) in the map's frame.
            captured_s: capture time of the newest view.
        """
        cells = self._cells(places_m)
        inside = ((cells >= 0) & (cells < self.seen_s.shape[0])).all(axis=1)
        shown = np.zeros(len(places_m), dtype=bool)
        shown[inside] = self.seen_s[tuple(cells[inside].T)] == captured_s
        return shown

    def note_moving(self, places_m: Floats, captured_s: float) -> None:
        """Record movers and possible movers.

        Args:
            places_m: (K, 2) their middles in the map's frame.
            captured_s: capture time of the view that shows them.
        """
        cells = (self._cells(places_m)[:, None, :] + self._lane).reshape(-1, 2)
        inside = ((cells >= 0) & (cells < self.seen_s.shape[0])).all(axis=1)
        self._moved_s[tuple(cells[inside].T)] = captured_s
        self._has_moved |= bool(inside.any())

    def lanes_m(self, now_s: float) -> Floats:
        """Return places where a mover was and to which it may have returned unseen, (K, 2)."""
        if not self._has_moved:
            return np.empty((0, 2))
        cfg = self.config
        lately = self._moved_s >= now_s - cfg.lane_s
        unseen = self.seen_s < now_s - cfg.looked_s
        cells = np.argwhere(lately & unseen)
        return np.asarray((cells - self.seen_s.shape[0] // 2) * cfg.cell_m)

    def outside(self, window: tuple[slice, slice]) -> Flags:
        """Return which cells of a window lie beyond the edge of the ground."""
        return np.asarray(self._beyond[window] > 0)

    def is_beyond_edge(self, x_m: float, y_m: float) -> bool:
        """Return whether a place lies beyond the edge of the ground, and further than a margin."""
        row, column = self._cells(np.array([[x_m, y_m]]))[0]
        return is_beyond_edge(self._beyond, int(row), int(column), self.config.cell_m)

    def window(self, margin: int = 6) -> tuple[slice, slice]:
        """Return the part of the grid that holds everything seen.

        Args:
            margin: cells around it.
        """
        side = self.seen_s.shape[0]
        low = np.maximum(self._low - margin, 0)
        high = np.minimum(self._high + margin + 1, side)
        return slice(int(low[0]), int(high[0])), slice(int(low[1]), int(high[1]))

    def corner_m(self, window: tuple[slice, slice]) -> tuple[float, float]:
        """Return the centre of a window's first cell."""
        cfg = self.config
        middle = self.seen_s.shape[0] // 2
        return (
            (window[0].start - middle) * cfg.cell_m,
            (window[1].start - middle) * cfg.cell_m,
        )

    def _cells(self, places_m: Floats) -> NDArray[np.intp]:
        middle = self.seen_s.shape[0] // 2
        return np.asarray(np.rint(places_m / self.config.cell_m).astype(np.intp) + middle)

    def _use(self, cells: NDArray[np.intp]) -> None:
        if len(cells):
            self._low = np.minimum(self._low, cells.min(axis=0))
            self._high = np.maximum(self._high, cells.max(axis=0))


@compiled(
    "Tuple((intp[:, ::1], boolean))"
    "(float64[:, :, ::1], uint8[:, ::1], UniTuple(float64, 4), UniTuple(float64, 3), int64,"
    " int8[:, ::1], float64[:, ::1], boolean[:, ::1])"
)
def _vote(  # noqa: PLR0917 - Numba passes arguments by position
    level_m: Floats,
    roles: NDArray[np.uint8],
    lens_at: tuple[float, float, float, float],
    limits: tuple[float, float, float],
    max_votes: int,
    beyond: NDArray[np.int8],
    seen_s: Floats,
    free: Flags,
) -> tuple[Indices, bool]:
    """Let the samples of a view vote whether cells are ground or beyond its end.

    Args:
        level_m: (B, E, 2) samples, forward and right of the point below the camera.
        roles: (B, E) their role ids.
        lens_at: x and y of the camera in the map's frame, m; cosine and sine of its heading.
        limits: capture time, s; range of samples that count, m; side of a cell, m.
        max_votes: limit of the votes.
        beyond: (S, S) votes of all views, changed.
        seen_s: (S, S) capture times, changed.
        free: (S, S) cells free of obstacles, changed.

    Returns:
        (2, 2) the lowest and the highest row and column with a sample, the lowest above the highest
        without any; and whether ground lay outside the grid.
    """
    x_m, y_m, cos, sin = lens_at
    captured_s, max_range_m, cell_m = limits
    side = beyond.shape[0]
    middle = side // 2
    more_ground = np.zeros((side, side), dtype=np.int32)  # samples of ground less those beyond
    used = np.array([[side, side], [-1, -1]], dtype=np.intp)
    outside = False
    for bearing in range(roles.shape[0]):
        for sample in range(roles.shape[1]):
            role = roles[bearing, sample]
            forward_m, right_m = level_m[bearing, sample, 0], level_m[bearing, sample, 1]
            if role not in (GROUND, OUTSIDE) or (np.hypot(forward_m, right_m) > max_range_m):
                continue
            row = int(np.rint((forward_m * cos - right_m * sin + x_m) / cell_m)) + middle
            column = int(np.rint((forward_m * sin + right_m * cos + y_m) / cell_m)) + middle
            if 0 <= row < side and 0 <= column < side:
                more_ground[row, column] += 1 if role == GROUND else -1
                used[0, 0], used[0, 1] = min(used[0, 0], row), min(used[0, 1], column)
                used[1, 0], used[1, 1] = max(used[1, 0], row), max(used[1, 1], column)
            elif role == GROUND:
                outside = True
    for row in range(used[0, 0], used[1, 0] + 1):
        for column in range(used[0, 1], used[1, 1] + 1):
            if more_ground[row, column] > 0:
                beyond[row, column] = max(beyond[row, column] - 1, -max_votes)
                seen_s[row, column] = captured_s
                free[row, column] = True
            elif more_ground[row, column] < 0:
                beyond[row, column] = min(beyond[row, column] + 1, max_votes)
    return used, outside


@compiled(
    "void(float64[:, :, ::1], uint8[:, ::1], UniTuple(float64, 4), UniTuple(float64, 3), int64,"
    " boolean[:, ::1])"
)
def _clear_below(  # noqa: PLR0917 - Numba passes arguments by position
    level_m: Floats,
    roles: NDArray[np.uint8],
    lens_at: tuple[float, float, float, float],
    limits: tuple[float, float, float],
    every: int,
    free: Flags,
) -> None:
    """Mark the cells between the camera and the nearest ground in view as free.

    An obstacle there that reached the flight height would hide that ground.

    Args:
        level_m: (B, E, 2) samples, forward and right of the point below the camera.
        roles: (B, E) their role ids.
        lens_at: x and y of the camera in the map's frame, m; cosine and sine of its heading.
        limits: step along a bearing, greatest range, side of a cell, m.
        every: the number of bearings of which one is cleared.
        free: (S, S) cells free of obstacles, changed.
    """
    x_m, y_m, cos, sin = lens_at
    step_m, max_range_m, cell_m = limits
    side = free.shape[0]
    middle = side // 2
    steps = int(np.ceil((max_range_m - step_m) / step_m))
    for bearing in range(0, roles.shape[0], every):
        nearest = 0
        while nearest < roles.shape[1] and roles[bearing, nearest] == NO_ROLE:
            nearest += 1
        if nearest == roles.shape[1] or (roles[bearing, nearest] not in (GROUND, MARK)):
            continue
        forward_m, right_m = level_m[bearing, nearest, 0], level_m[bearing, nearest, 1]
        length_m = max(np.hypot(forward_m, right_m), step_m)
        for step in range(steps):
            share = (step_m + step * step_m) / length_m
            if share >= 1.0:
                break
            near_m, beside_m = forward_m * share, right_m * share
            row = int(np.rint((near_m * cos - beside_m * sin + x_m) / cell_m)) + middle
            column = int(np.rint((near_m * sin + beside_m * cos + y_m) / cell_m)) + middle
            if 0 <= row < side and 0 <= column < side:
                free[row, column] = True


def _disc(radius_cells: float) -> Flags:
    reach = int(radius_cells)
    down, right = np.mgrid[-reach : reach + 1, -reach : reach + 1]
    return np.asarray(np.hypot(down, right) <= radius_cells)


def _stamp(grid: Flags, row: int, column: int, disc: Flags) -> None:
    """Mark the cells around one, as far as the grid goes."""
    reach = disc.shape[0] // 2
    top, left = max(reach - row, 0), max(reach - column, 0)
    rows = slice(max(row - reach, 0), max(row + reach + 1, 0))
    columns = slice(max(column - reach, 0), max(column + reach + 1, 0))
    there = grid[rows, columns]
    there |= disc[top : top + there.shape[0], left : left + there.shape[1]]
