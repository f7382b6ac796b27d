"""The map's grid: seen ground, its end, and cells passed by the drone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from perception.mapping.contact_scan import NO_CLASS
from perception.mapping.view import View
from uav_bt.classes import GROUP_BACKGROUND, GROUP_CARPET, GROUP_HELIPAD
from uav_bt.errors import ValueRangeError
from uav_bt.types.arrays import Flags, Floats
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
        groups = scan.groups
        near = np.hypot(*np.moveaxis(scan.level_m, -1, 0)) <= cfg.max_range_m
        is_ground = near & (groups == GROUP_CARPET)
        is_beyond = near & (groups == GROUP_BACKGROUND)
        ground = self._inside(lens.points_to_world(scan.level_m[is_ground]))
        self.full |= bool(len(ground) < np.count_nonzero(is_ground))
        beyond = self._inside(lens.points_to_world(scan.level_m[is_beyond]))
        both = np.concatenate([ground, beyond])
        self._use(both)
        if len(both):
            low, size = both.min(axis=0), np.ptp(both, axis=0) + 1
            window = slice(low[0], low[0] + size[0]), slice(low[1], low[1] + size[1])
            more_ground = _counts(ground - low, size) - _counts(beyond - low, size)
            more, less, votes = more_ground > 0, more_ground < 0, self._beyond[window]
            votes[more] = np.maximum(votes[more] - 1, -cfg.max_votes)
            votes[less] = np.minimum(votes[less] + 1, cfg.max_votes)
            self.seen_s[window][more] = view.captured_s
            self.free[window][more] = True
        self._clear_below(view)

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

    def _clear_below(self, view: View) -> None:
        """Mark the cells between the camera and the nearest ground in view as free.

        An obstacle there that reached the flight height would hide that ground.
        """
        cfg, scan = self.config, view.scan
        groups, level_m = scan.groups[:: cfg.near_bearings], scan.level_m[:: cfg.near_bearings]
        first = (groups != NO_CLASS).argmax(axis=1)
        rows = np.arange(len(groups))
        shows = np.isin(groups[rows, first], (GROUP_CARPET, GROUP_HELIPAD))
        ends = level_m[rows, first][shows]
        lengths = np.hypot(*ends.T)
        steps = np.arange(cfg.near_step_m, cfg.max_range_m, cfg.near_step_m)
        shares = steps / np.maximum(lengths, cfg.near_step_m)[:, None]
        below = (ends[:, None, :] * shares[..., None])[shares < 1.0]
        cells = self._inside(view.lens.points_to_world(below))
        self.free[tuple(cells.T)] = True

    def _inside(self, places_m: Floats) -> NDArray[np.intp]:
        cells = self._cells(places_m)
        inside = ((cells >= 0) & (cells < self.seen_s.shape[0])).all(axis=1)
        return np.asarray(cells[inside])

    def _cells(self, places_m: Floats) -> NDArray[np.intp]:
        middle = self.seen_s.shape[0] // 2
        return np.asarray(np.rint(places_m / self.config.cell_m).astype(np.intp) + middle)

    def _use(self, cells: NDArray[np.intp]) -> None:
        if len(cells):
            self._low = np.minimum(self._low, cells.min(axis=0))
            self._high = np.maximum(self._high, cells.max(axis=0))


def _counts(cells: NDArray[np.intp], size: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return how often each cell occurs in a window, given its rows and columns."""
    flat = np.bincount(cells[:, 0] * size[1] + cells[:, 1], minlength=int(size.prod()))
    return flat.reshape(size)


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
