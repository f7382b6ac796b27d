"""Next-best-view planner: the view that shows the most unseen ground per second.

From each reachable place, rays are cast over the site map to an obstacle or the edge of the ground.
Cells on them that were not seen as ground may hold the landing mark.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from behaviours.path.clearance import ClearanceMap
from uav_bt.types import CameraModel, wrap_angles
from uav_bt.types.arrays import Flags, Floats

_SOLID_CELLS: Final = 1.5  # a ray ends within this distance of an obstacle, cells


@dataclass(frozen=True, kw_only=True)
class ViewpointConfig:
    """How viewpoints are evaluated. The numbers were chosen in drawn and simulated halls.

    Attributes:
        far_m: Ground further away does not count: the mark is small there.
        bearings: Number of headings at each place.
        grid_step: Cells between two places that are evaluated.
        min_view_m2: Least unseen area that makes a view worth flying to. The pad has 0.25 m2.
        look_s: Time spent at the viewpoint.
        yaw_rate_radps: Rate of turns.
    """

    far_m: float = 3.5
    bearings: int = 48
    grid_step: int = 4
    min_view_m2: float = 0.15
    look_s: float = 1.0
    yaw_rate_radps: float = 0.8

    def around_cells(self, cell_m: float) -> int:
        """Return the number of cells beyond the map that a view may show."""
        return math.ceil(self.far_m / cell_m)


@dataclass(frozen=True, kw_only=True)
class GroundInView:
    """The ground that the camera shows in level flight: a sector of a ring.

    Attributes:
        near_m: Inner radius of the ring.
        far_m: Outer radius of the ring.
        half_rad: Half of the sector's angle.
    """

    near_m: float
    far_m: float
    half_rad: float

    @classmethod
    def of(
        cls, camera: CameraModel, pitch_rad: float, height_m: float, far_m: float
    ) -> GroundInView:
        """Return the ground in view of a camera.

        Args:
            camera: Intrinsics at any size.
            pitch_rad: Pitch of the gimbal, negative down.
            height_m: Height above the ground.
            far_m: Largest outer radius.
        """
        low_rad = pitch_rad - math.atan((camera.height_px - camera.cy_px) / camera.fy_px)
        high_rad = pitch_rad + math.atan(camera.cy_px / camera.fy_px)
        near_m = height_m / math.tan(-low_rad) if -math.pi / 2 < low_rad < 0.0 else 0.0
        beyond_m = height_m / math.tan(-high_rad) if high_rad < 0.0 else math.inf
        return cls(
            near_m=min(near_m, 0.7 * far_m),
            far_m=min(beyond_m, far_m),
            half_rad=math.atan(camera.cx_px / camera.fx_px),
        )


@dataclass(frozen=True, kw_only=True)
class Viewpoint:
    """A place and a heading to look from, in the map's frame.

    Attributes:
        x_m: x of the place.
        y_m: y of the place.
        yaw_rad: Heading of the view.
        shows_m2: Area of unseen ground in view.
    """

    x_m: float
    y_m: float
    yaw_rad: float
    shows_m2: float


def unseen(clearance: ClearanceMap, since_s: float, config: ViewpointConfig) -> Flags:
    """Return the unseen cells that may be ground or hold a landing mark.

    Args:
        clearance: The clearance map.
        since_s: Ground last seen before this time counts as unseen; -inf for none.
        config: Reach of views.

    Returns:
        Flags of the map's cells, extended by `config.around_cells` on each side.
    """
    solid = clearance.obstacle_m < _SOLID_CELLS * clearance.map.cell_m
    seen = clearance.map.ground & (clearance.map.seen_s >= since_s)
    around = config.around_cells(clearance.map.cell_m)
    return np.pad(~seen & ~clearance.map.outside & ~solid, around, constant_values=True)


def best_viewpoint(
    clearance: ClearanceMap, wanted: Flags, in_view: GroundInView, config: ViewpointConfig
) -> Viewpoint | None:
    """Return the view that shows the most wanted ground per second; None if none is worth it.

    Args:
        clearance: The clearance map, with the paths to the viewpoints.
        wanted: Cells to see, as `unseen` returns them.
        in_view: The ground that the camera shows.
        config: How views are evaluated.
    """
    step = config.grid_step
    tried = np.zeros(clearance.map.seen_s.shape, dtype=bool)
    tried[::step, ::step] = True
    tried[clearance.start] = True
    places = np.argwhere(tried & np.isfinite(clearance.fastest.time_s))
    shown_m2 = _shown_m2(clearance, wanted, places, in_view, config)
    spent_s = config.look_s + _times_s(clearance, places, config)
    worth = np.where(shown_m2 >= config.min_view_m2, shown_m2 / spent_s, 0.0)
    place, bearing = np.unravel_index(int(worth.argmax()), worth.shape)
    if worth[place, bearing] <= 0.0:
        return None
    x_m, y_m = np.array(clearance.map.corner_m) + clearance.map.cell_m * places[place]
    return Viewpoint(
        x_m=float(x_m),
        y_m=float(y_m),
        yaw_rad=2.0 * math.pi * float(bearing) / config.bearings,
        shows_m2=float(shown_m2[place, bearing]),
    )


def still_shows_m2(
    view: Viewpoint,
    clearance: ClearanceMap,
    wanted: Flags,
    in_view: GroundInView,
    config: ViewpointConfig,
) -> float:
    """Return the area of wanted cells that a view shows now, m2."""
    place = np.array([clearance.map.cell_of(view.x_m, view.y_m)])
    return float(_shown_m2(clearance, wanted, place, in_view, config)[0, _bearing(view, config)])


def shown_by(
    view: Viewpoint, clearance: ClearanceMap, in_view: GroundInView, config: ViewpointConfig
) -> Floats:
    """Return the places that a view shows, (N, 2) in the map's frame."""
    rows, columns, ranges_m, clear = _rays(
        clearance, np.array([clearance.map.cell_of(view.x_m, view.y_m)]), in_view, config
    )
    fan = (_bearing(view, config) + _fan(in_view, config)) % config.bearings
    within = clear[0, fan] & (ranges_m >= in_view.near_m)
    cells = np.stack([rows[0, fan][within], columns[0, fan][within]], axis=-1)
    return np.asarray(np.array(clearance.map.corner_m) + clearance.map.cell_m * cells)


def _shown_m2(
    clearance: ClearanceMap,
    wanted: Flags,
    places: NDArray[np.intp],
    in_view: GroundInView,
    config: ViewpointConfig,
) -> Floats:
    """Return the area of wanted cells in view from each place, m2, (K, bearings)."""
    rows, columns, ranges_m, clear = _rays(clearance, places, in_view, config)
    around = config.around_cells(clearance.map.cell_m)
    hit = clear & _looked_up(wanted, rows + around, columns + around)
    area_m2 = ranges_m * (ranges_m >= in_view.near_m)
    area_m2 = area_m2 * clearance.map.cell_m * 2.0 * math.pi / config.bearings
    by_bearing = hit @ area_m2
    fan = _fan(in_view, config)
    return np.asarray(sum(np.roll(by_bearing, turn, axis=1) for turn in fan))


def _rays(
    clearance: ClearanceMap,
    places: NDArray[np.intp],
    in_view: GroundInView,
    config: ViewpointConfig,
) -> tuple[NDArray[np.intp], NDArray[np.intp], Floats, Flags]:
    """Return the samples of the rays around each place.

    Returns:
        Rows and columns of the samples' cells, (K, bearings, S) each; the samples' ranges, metres,
        (S,); whether the ray reaches each sample, (K, bearings, S).
    """
    cell_m = clearance.map.cell_m
    ranges_m = np.arange(cell_m, in_view.far_m, cell_m)
    azimuths = 2.0 * math.pi * np.arange(config.bearings) / config.bearings
    rows = np.rint(np.cos(azimuths)[:, None] * ranges_m / cell_m).astype(np.intp)
    columns = np.rint(np.sin(azimuths)[:, None] * ranges_m / cell_m).astype(np.intp)
    rows, columns = rows + places[:, :1, None], columns + places[:, 1:, None]
    solid = (clearance.obstacle_m < _SOLID_CELLS * cell_m) | clearance.map.outside
    ends = _looked_up(solid, rows, columns)
    return rows, columns, ranges_m, ~np.logical_or.accumulate(ends, axis=2)


def _bearing(view: Viewpoint, config: ViewpointConfig) -> int:
    return round(view.yaw_rad / (2.0 * math.pi) * config.bearings) % config.bearings


def _fan(in_view: GroundInView, config: ViewpointConfig) -> NDArray[np.intp]:
    """Return the indices of a view's bearings relative to its middle."""
    width = math.floor(in_view.half_rad / (2.0 * math.pi) * config.bearings)
    return np.arange(-width, width + 1)


def _looked_up(grid: Flags, rows: NDArray[np.intp], columns: NDArray[np.intp]) -> Flags:
    """Return the cells' values; False beyond the grid."""
    height, width = grid.shape
    inside = (rows >= 0) & (rows < height) & (columns >= 0) & (columns < width)
    found = grid[np.clip(rows, 0, height - 1), np.clip(columns, 0, width - 1)]
    return np.asarray(inside & found)


def _times_s(clearance: ClearanceMap, places: NDArray[np.intp], config: ViewpointConfig) -> Floats:
    """Return the time to fly to each place and turn to each bearing, s, (K, bearings)."""
    start, before = np.array(clearance.start), clearance.fastest.before
    yaw_rad = clearance.map.pose.yaw_rad
    apart = places - start
    first_rad = np.where(apart.any(axis=1), np.arctan2(apart[:, 1], apart[:, 0]), yaw_rad)
    came_from = before[tuple(places.T)]
    rows, columns = np.divmod(np.maximum(came_from, 0), before.shape[1])
    last_rad = np.arctan2(places[:, 1] - columns, places[:, 0] - rows)
    last_rad = np.where(came_from >= 0, last_rad, yaw_rad)
    azimuths = 2.0 * math.pi * np.arange(config.bearings) / config.bearings
    turn_rad = np.abs(wrap_angles(first_rad - yaw_rad))[:, None]
    turn_rad = turn_rad + np.abs(wrap_angles(azimuths - last_rad[:, None]))
    return np.asarray(
        clearance.fastest.time_s[tuple(places.T)][:, None] + turn_rad / config.yaw_rate_radps
    )
