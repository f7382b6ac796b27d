"""The map's grid: seen ground, its end, and cells passed by the drone."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from perception.mapping.view import View
from uav_bt.lab.classes import GROUND, MARK, NO_ROLE, OUTSIDE
from uav_bt.types.arrays import Flags, Floats
from uav_bt.types.site_map import is_beyond_edge

CELL_M: Final = 0.1  # side of a cell; chosen
REACH_M: Final = 12.0  # from the take-off point in each direction; chosen
PASSED_M: Final = 0.5  # cells this near to the flown path were passed; as `coverage_passed`
_MIDDLE: Final = round(REACH_M / CELL_M)  # row and column of the take-off point
_SIDE: Final = 2 * _MIDDLE + 1  # cells
_MAX_RANGE_M: Final = 4.0  # ground further from the camera is seen at too flat an angle; chosen
# Views vote whether a cell is ground or beyond its end; votes are limited to this. Chosen.
_MAX_VOTES: Final = 6
_NEAR_STEP_M: Final = 0.08  # step along cleared bearings; chosen smaller than a cell
_NEAR_BEARINGS: Final = 3  # every n-th bearing of the scan is cleared; chosen
_AROUND_M: Final = 0.1  # ground must be seen this far around a place, its error at range; chosen
_LANE_S: Final = 90.0  # a mover may return to a former place within this time; chosen
_LOOKED_S: Final = 0.4  # ground seen within this time is free of movers; chosen
_LANE_M: Final = 0.2  # radius of a lane around a mover's path; chosen
_BODY_M: Final = 0.35  # cells this near to the drone are free; chosen
_MARGIN: Final = 6  # cells around everything seen


def _disc(radius_m: float) -> NDArray[np.intp]:
    """Return the cells within a distance of the cell (0, 0), (N, 2)."""
    reach = int(radius_m / CELL_M)
    square = np.mgrid[-reach : reach + 1, -reach : reach + 1].reshape(2, -1).T
    return np.asarray(square[np.hypot(*square.T) <= radius_m / CELL_M])


class GroundGrid:
    """Cells around the take-off point, rows along x, columns along y of the map's frame."""

    def __init__(self) -> None:
        self.seen_s = np.full((_SIDE, _SIDE), -np.inf)  # float64: clocks may count from 1970
        self.free = np.zeros((_SIDE, _SIDE), dtype=bool)
        self.passed = np.zeros((_SIDE, _SIDE), dtype=bool)
        self._beyond = np.zeros((_SIDE, _SIDE), dtype=np.int8)  # votes: positive is beyond the edge
        self._moved_s = np.full((_SIDE, _SIDE), -np.inf)  # last time of a mover there
        self._has_moved = False
        self._passed, self._body = _disc(PASSED_M), _disc(_BODY_M)
        self._around, self._lane = _disc(_AROUND_M), _disc(_LANE_M)
        self._low, self._high = np.full(2, _MIDDLE), np.full(2, _MIDDLE)  # cells in use
        self.full = False  # something lay outside the grid

    def add(self, view: View) -> None:
        """Add the ground in a view, which is placed in the map's frame."""
        scan, lens = view.scan, view.lens
        votes = np.isin(scan.roles, (GROUND, OUTSIDE))
        votes &= np.hypot(scan.level_m[..., 0], scan.level_m[..., 1]) <= _MAX_RANGE_M
        ground, (ahead_m, right_m) = scan.roles[votes] == GROUND, scan.level_m[votes].T
        cos, sin = math.cos(lens.yaw_rad), math.sin(lens.yaw_rad)
        x_m, y_m = ahead_m * cos - right_m * sin, ahead_m * sin + right_m * cos
        cells = _cells(np.column_stack([x_m + lens.x_m, y_m + lens.y_m]))
        inside = _inside(cells)
        self.full |= bool((ground & ~inside).any())
        if inside.any():
            self._use(cells[inside])
            codes = cells[inside] @ (_SIDE, 1)
            more = np.bincount(codes, np.where(ground[inside], 1.0, -1.0), minlength=_SIDE**2)
            more_ground = more.reshape(_SIDE, _SIDE)  # samples of ground less those beyond
            beyond = self._beyond - np.sign(more_ground).astype(np.int8)
            self._beyond = np.clip(beyond, -_MAX_VOTES, _MAX_VOTES)
            self.seen_s[more_ground > 0.0] = view.captured_s
            self.free[more_ground > 0.0] = True
        self._clear_below(view)

    def _clear_below(self, view: View) -> None:
        """Mark the cells between the camera and the nearest ground in view as free.

        An obstacle there that reached the flight height would hide that ground.
        """
        roles = view.scan.roles[::_NEAR_BEARINGS]
        if not roles.size:  # of a camera that looks up
            return
        first = np.arange(len(roles)), (roles != NO_ROLE).argmax(axis=1)
        lands = (roles[first] == GROUND) | (roles[first] == MARK)
        nearest_m = view.scan.level_m[::_NEAR_BEARINGS][first][lands]
        length_m = np.maximum(np.hypot(*nearest_m.T), _NEAR_STEP_M)
        shares = np.arange(_NEAR_STEP_M, _MAX_RANGE_M, _NEAR_STEP_M) / length_m[:, None]
        places_m = (nearest_m[:, None] * shares[..., None])[shares < 1.0]
        cells = _cells(view.lens.points_to_world(places_m))
        self.free[tuple(cells[_inside(cells)].T)] = True

    def fly_over(self, x_m: float, y_m: float) -> None:
        """Mark the cells below the drone as passed and free of obstacles."""
        cell = _cells(np.array([[x_m, y_m]]))
        for grid, disc in ((self.passed, self._passed), (self.free, self._body)):
            cells = cell + disc
            grid[tuple(cells[_inside(cells)].T)] = True
        inside = bool(_inside(cell).all())
        self.full |= not inside
        if inside:
            self._use(cell)

    def was_ground(self, places_m: Floats) -> Flags:
        """Return which places, (N, 2) in the map's frame, have all ground around them seen."""
        seen_s = self._seen_s(_cells(places_m)[:, None, :] + self._around)
        return np.asarray(np.isfinite(seen_s).all(axis=1))

    def shows_ground(self, place_m: Floats, *, since_s: float) -> bool:
        """Return whether all ground around a place, (2,), was seen after `since_s`."""
        return bool((self._seen_s(_cells(place_m) + self._around) > since_s).all())

    def shown_at(self, places_m: Floats, captured_s: float) -> Flags:
        """Return at which places, (N, 2), the newest view showed ground; it was captured then."""
        return np.asarray(self._seen_s(_cells(places_m)) == captured_s)

    def _seen_s(self, cells: NDArray[np.intp]) -> Floats:
        """Return when cells, (..., 2), last showed ground; -inf outside the grid."""
        inside, seen_s = _inside(cells), np.full(cells.shape[:-1], -np.inf)
        seen_s[inside] = self.seen_s[tuple(cells[inside].T)]
        return seen_s

    def note_moving(self, places_m: Floats, captured_s: float) -> None:
        """Record the middles of movers and possible movers, (K, 2), that a view shows."""
        cells = (_cells(places_m)[:, None, :] + self._lane).reshape(-1, 2)
        inside = _inside(cells)
        self._moved_s[tuple(cells[inside].T)] = captured_s
        self._has_moved |= bool(inside.any())

    def lanes_m(self, now_s: float) -> Floats:
        """Return places where a mover was and to which it may have returned unseen, (K, 2)."""
        if not self._has_moved:
            return np.empty((0, 2))
        unseen = self.seen_s < now_s - _LOOKED_S
        cells = np.argwhere((self._moved_s >= now_s - _LANE_S) & unseen)
        return np.asarray((cells - _MIDDLE) * CELL_M)

    def outside(self, window: tuple[slice, slice]) -> Flags:
        """Return which cells of a window lie beyond the edge of the ground."""
        return np.asarray(self._beyond[window] > 0)

    def is_beyond_edge(self, x_m: float, y_m: float) -> bool:
        """Return whether a place lies beyond the edge of the ground, and further than a margin."""
        row, column = _cells(np.array([x_m, y_m]))
        return is_beyond_edge(self._beyond, int(row), int(column), CELL_M)

    def window(self) -> tuple[slice, slice]:
        """Return the part of the grid that holds everything seen, and a margin."""
        low = np.maximum(self._low - _MARGIN, 0)
        high = np.minimum(self._high + _MARGIN + 1, _SIDE)
        return slice(int(low[0]), int(high[0])), slice(int(low[1]), int(high[1]))

    def corner_m(self, window: tuple[slice, slice]) -> tuple[float, float]:
        """Return the centre of a window's first cell."""
        return (window[0].start - _MIDDLE) * CELL_M, (window[1].start - _MIDDLE) * CELL_M

    def _use(self, cells: NDArray[np.intp]) -> None:
        self._low = np.minimum(self._low, cells.min(axis=0))
        self._high = np.maximum(self._high, cells.max(axis=0))


def _cells(places_m: Floats) -> NDArray[np.intp]:
    return np.asarray(np.rint(places_m / CELL_M).astype(np.intp) + _MIDDLE)


def _inside(cells: NDArray[np.intp]) -> Flags:
    return np.asarray(((cells >= 0) & (cells < _SIDE)).all(axis=-1))
