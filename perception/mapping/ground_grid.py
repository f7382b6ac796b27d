"""The map's grid: seen ground, its end, and cells passed by the drone."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from perception.mapping.view import View
from uav_bt.compiled import compiled
from uav_bt.lab.classes import GROUND, MARK, NO_ROLE, OUTSIDE
from uav_bt.types.arrays import Flags, Floats, Ids, Indices
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
_NEAR_M: Final = np.arange(_NEAR_STEP_M, _MAX_RANGE_M, _NEAR_STEP_M)
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
        lens = view.lens
        lens_at = lens.x_m, lens.y_m, math.cos(lens.yaw_rad), math.sin(lens.yaw_rad)
        samples, grids = (view.scan.level_m, view.scan.roles), (self._beyond, self.seen_s)
        _clear_below(*samples, lens_at, self.free)
        used, beyond = _vote(*samples, lens_at, view.captured_s, *grids, self.free)
        self.full |= beyond
        if used[0, 0] <= used[1, 0]:
            self._use(used)

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
        cells = np.argwhere(self._moved_s >= now_s - _LANE_S)
        unseen = self.seen_s[tuple(cells.T)] < now_s - _LOOKED_S
        return np.asarray((cells[unseen] - _MIDDLE) * CELL_M)

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


@compiled(
    "Tuple((intp[:, ::1], boolean))(float64[:, :, ::1], uint8[:, ::1], UniTuple(float64, 4),"
    " float64, int8[:, ::1], float64[:, ::1], boolean[:, ::1])"
)
def _vote(  # noqa: PLR0917 - Numba passes arguments by position
    level_m: Floats,
    roles: Ids,
    lens_at: tuple[float, float, float, float],
    captured_s: float,
    beyond: NDArray[np.int8],
    seen_s: Floats,
    free: Flags,
) -> tuple[Indices, bool]:
    """Let the samples of a scan vote whether cells are ground; the last three grids are changed.

    `lens_at` is the camera's position in the map's frame, cosine and sine of its heading. Return
    the lowest and the highest row and column with a sample, (2, 2), the lowest above the highest
    without any; and whether ground lay outside the grid.
    """
    x_m, y_m, cos, sin = lens_at
    more_ground = np.zeros((_SIDE, _SIDE), dtype=np.int32)  # samples of ground less those beyond
    used, full = np.array([[_SIDE, _SIDE], [-1, -1]]), False
    for bearing in range(roles.shape[0]):
        for sample in range(roles.shape[1]):
            role = roles[bearing, sample]
            ahead_m, right_m = level_m[bearing, sample, 0], level_m[bearing, sample, 1]
            if role not in (GROUND, OUTSIDE) or (np.hypot(ahead_m, right_m) > _MAX_RANGE_M):
                continue
            row = int(np.rint((ahead_m * cos - right_m * sin + x_m) / CELL_M)) + _MIDDLE
            column = int(np.rint((ahead_m * sin + right_m * cos + y_m) / CELL_M)) + _MIDDLE
            if 0 <= row < _SIDE and 0 <= column < _SIDE:
                more_ground[row, column] += 1 if role == GROUND else -1
                used[0, 0], used[0, 1] = min(used[0, 0], row), min(used[0, 1], column)
                used[1, 0], used[1, 1] = max(used[1, 0], row), max(used[1, 1], column)
            elif role == GROUND:
                full = True
    for row in range(used[0, 0], used[1, 0] + 1):
        for column in range(used[0, 1], used[1, 1] + 1):
            if more_ground[row, column] > 0:
                beyond[row, column] = max(beyond[row, column] - 1, -_MAX_VOTES)
                seen_s[row, column], free[row, column] = captured_s, True
            elif more_ground[row, column] < 0:
                beyond[row, column] = min(beyond[row, column] + 1, _MAX_VOTES)
    return used, full


@compiled("void(float64[:, :, ::1], uint8[:, ::1], UniTuple(float64, 4), boolean[:, ::1])")
def _clear_below(
    level_m: Floats,
    roles: Ids,
    lens_at: tuple[float, float, float, float],
    free: Flags,
) -> None:
    """Mark the cells between the camera and the nearest ground in view as free.

    An obstacle there that reached the flight height would hide that ground.
    """
    x_m, y_m, cos, sin = lens_at
    for bearing in range(0, roles.shape[0], _NEAR_BEARINGS):
        nearest = 0
        while nearest < roles.shape[1] and roles[bearing, nearest] == NO_ROLE:
            nearest += 1
        if nearest == roles.shape[1] or (roles[bearing, nearest] not in (GROUND, MARK)):
            continue
        ahead_m, right_m = level_m[bearing, nearest, 0], level_m[bearing, nearest, 1]
        length_m = max(np.hypot(ahead_m, right_m), _NEAR_STEP_M)
        for near_m in _NEAR_M[length_m > _NEAR_M]:
            near_x, near_y = ahead_m * (near_m / length_m), right_m * (near_m / length_m)
            row = int(np.rint((near_x * cos - near_y * sin + x_m) / CELL_M)) + _MIDDLE
            column = int(np.rint((near_x * sin + near_y * cos + y_m) / CELL_M)) + _MIDDLE
            if 0 <= row < _SIDE and 0 <= column < _SIDE:
                free[row, column] = True
