"""The room at a place, and why no way leads there, in words for status line and report."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from operator import attrgetter
from typing import Final

import numpy as np

from behaviours.path.clearance import Place
from behaviours.path.fastest import fastest_paths
from behaviours.path.margins import Margins, Passage
from behaviours.path.passages import ClearanceMaps
from uav_bt.types.arrays import Floats
from uav_bt.types.ground import Footprint
from uav_bt.types.place_frames import start_place
from uav_bt.types.site_map import MapObject, SiteMap

_OWN_M: Final = 0.2  # obstacle points this near to the base of an object belong to it; chosen
# The widest way: a cell costs `clear_m` to the power of minus 4, so that one narrow cell outweighs
# a long detour. Unseen cells cost more than narrow ones, and obstacles more than unseen cells.
_POWER: Final = 4
_UNSEEN_M, _SOLID_M = 0.05, 0.01
EDGE: Final = "the edge of the ground"
BEYOND: Final = "the place lies beyond the edge of the ground"


@dataclass(frozen=True, kw_only=True)
class Room:
    """The distance of a place from what leaves it least room."""

    apart_m: float
    needed_m: float
    what: str

    @property
    def short_m(self) -> float:
        """The distance that lacks; negative where there is room."""
        return self.needed_m - self.apart_m

    def __str__(self) -> str:
        return f"{self.apart_m:.2f} m to {self.what}, {self.needed_m:.2f} m needed"


_short_m = attrgetter("short_m")


def room_at(place: Place, maps: ClearanceMaps, passage: Passage = Passage.OUT) -> Room:
    """Return what leaves least room at a place: an obstacle or edge, else what was not seen."""
    margins = maps[passage].margins
    worst = max(_lasting(place, maps, margins), key=_short_m)
    return (
        worst if worst.short_m > 0.0 else max(worst, *_passing(place, maps, margins), key=_short_m)
    )


def _lasting(place: Place, maps: ClearanceMaps, margins: Margins) -> Iterator[Room]:
    site_map, touch_m = maps.map, margins.touch_m
    for item in site_map.objects:
        apart_m = _base(item).distance_m(*place)
        yield Room(apart_m=apart_m, needed_m=touch_m, what=_name(item, site_map))
    points_m = np.vstack([site_map.obstacles_m, maps.recent.seen_m])
    point_m, apart_m = _nearest(place, points_m)
    own = (each for each in site_map.objects if each.covers(*point_m, margin_m=_OWN_M))
    what = next((_name(each, site_map) for each in own), "an obstacle")
    yield Room(apart_m=apart_m, needed_m=touch_m, what=what)
    cells_m = site_map.middles_m(np.argwhere(site_map.outside))
    edges_m = np.vstack([site_map.edges_m, maps.recent.edges_m, cells_m])
    yield Room(apart_m=_nearest(place, edges_m)[1], needed_m=margins.edge_m, what=EDGE)


def _passing(place: Place, maps: ClearanceMaps, margins: Margins) -> Iterator[Room]:
    """Yield what may be gone after another view."""
    site_map, grid = maps.map, maps[Passage.TIGHT]
    for mover in site_map.movers:
        apart_m = max(math.dist(place, (mover.x_m, mover.y_m)) - mover.radius_m, 0.0)
        yield Room(apart_m=apart_m, needed_m=margins.touch_m, what="a mover")
    unseen_m, apart_m = _nearest(place, site_map.middles_m(np.argwhere(grid.unknown())))
    beside = (each for each in site_map.objects if each.covers(*unseen_m, margin_m=2 * _OWN_M))
    names = [f" beside {_name(each, site_map)}" for each in beside][:1]
    unseen = f"ground{''.join(names)} that was never seen"
    yield Room(apart_m=apart_m, needed_m=margins.unknown_m, what=unseen)
    for points_m, needed_m, what in (
        (maps.recent.assumed_m, margins.doubt_m, "an obstacle whose base was not seen"),
        (site_map.lanes_m, margins.lane_m, "the path of a mover"),
    ):
        yield Room(apart_m=_nearest(place, points_m)[1], needed_m=needed_m, what=what)


def _nearest(place: Place, points_m: Floats) -> tuple[Place, float]:
    """Return the nearest point and its distance; inf without points."""
    if not len(points_m):
        return (math.inf, math.inf), math.inf
    apart_m = np.hypot(*(points_m - place).T)
    x_m, y_m = points_m[apart_m.argmin()].tolist()
    return (x_m, y_m), float(apart_m.min())


def _base(item: MapObject) -> Footprint:
    """Return the seen base of an object."""
    return Footprint(
        x_m=item.x_m,
        y_m=item.y_m,
        yaw_rad=item.yaw_rad,
        half_x_m=item.size_m / 2,
        half_y_m=item.width_m / 2,
    )


def _name(item: MapObject, site_map: SiteMap) -> str:
    """Return the class of an object, and the place that names it, such as box_2 (object:3)."""
    return f"{site_map.classes.names[item.class_id]}{f' (object:{item.id})' if item.id else ''}"


def no_way(place: Place, maps: ClearanceMaps, *, arrive_m: float) -> str:
    """Return why no route ends within `arrive_m` of a place."""
    site_map, widest = maps.map, maps[Passage.OUT]
    if site_map.is_beyond_edge(*place):
        return BEYOND
    cells = np.argwhere(widest.open)
    if (np.hypot(*(widest.map.middles_m(cells) - place).T) <= arrive_m).any():
        return _blocked(place, maps)
    known = max(_lasting(place, maps, widest.margins), key=_short_m).short_m > 0.0
    if not known and not site_map.lies_on(maps[Passage.TIGHT].free, np.array(place)):
        return "the place was never seen"
    return no_room(place, maps)


def no_room(place: Place, maps: ClearanceMaps) -> str:
    """Return what leaves too little room at a place that no route or last step reaches."""
    rooms = [room_at(place, maps, each) for each in (Passage.OUT, Passage.TIGHT)]
    room = next((each for each in rooms if each.short_m > 0.0), None)
    if room is None:  # by the rounding to cells
        room = replace(rooms[0], needed_m=rooms[0].needed_m + maps.map.cell_m / math.sqrt(2))
    return f"no room at the place: {room}"


def _blocked(place: Place, maps: ClearanceMaps) -> str:
    """Return where the widest way to a place is too narrow."""
    site_map, grid = maps.map, maps[Passage.TIGHT]
    clear_m = np.where(grid.obstacle_m < site_map.cell_m, _SOLID_M, grid.clear_m)
    clear_m = np.clip(clear_m, _SOLID_M, grid.margins.touch_m)
    clear_m[~grid.free] = np.minimum(clear_m, _UNSEEN_M)[~grid.free]
    crossed = ~site_map.outside
    crossed[grid.start] = True
    paths = fastest_paths(crossed, clear_m**-_POWER, grid.start)
    cells = np.stack(np.divmod(paths.reached, clear_m.shape[1]), axis=-1)
    ends_m = np.hypot(*(site_map.middles_m(cells) - place).T)
    row, column = cells[ends_m.argmin()].tolist()
    path = paths.to((row, column))
    spot = min(path, key=lambda cell: clear_m[cell])
    x_m, y_m = site_map.middles_m(np.array(spot)).tolist()
    at, room = start_place(site_map, x_m, y_m), room_at((x_m, y_m), maps)
    if clear_m[spot] == _SOLID_M:
        return f"no known way: {room.what} is in between, at {at}"
    if not grid.free[spot]:
        return f"no known way: the ground at {at} was never seen"
    return f"no known way is wide enough: at {at} {room}"
