"""The room at a place, and why no way leads there, in words for status line and report."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final, NamedTuple

import numpy as np

from behaviours.path.clearance import Place
from behaviours.path.fastest import fastest_paths
from behaviours.path.margins import Passage
from behaviours.path.movers import outlines_m
from behaviours.path.passages import ClearanceMaps
from uav_bt.types.arrays import Flags, Floats
from uav_bt.types.ground import Footprint
from uav_bt.types.place_frames import start_place
from uav_bt.types.pose import Pose2D
from uav_bt.types.site_map import MapObject

_OWN_M: Final = 0.2  # obstacle points this near to the base of an object belong to it; chosen
# The widest way: a cell costs its clearance to the power of minus 4, so that one narrow cell
# outweighs a long detour. Unseen cells cost more than narrow ones, obstacles more than unseen.
_POWER, _UNSEEN_M, _SOLID_M = 4, 0.05, 0.01
EDGE: Final = "the edge of the ground"
BEYOND: Final = f"the place lies beyond {EDGE}"


class Room(NamedTuple):
    """The distance of a place from what leaves it least room."""

    short_m: float  # the distance that lacks; negative where there is room
    needed_m: float
    what: str

    def __str__(self) -> str:
        apart_m = self.needed_m - self.short_m
        if apart_m < 0.0:
            return f"{-apart_m:.2f} m beyond {self.what}"
        return f"{apart_m:.2f} m to {self.what}, {self.needed_m:.2f} m needed"


def room_at(place: Place, maps: ClearanceMaps, passage: Passage = Passage.OUT) -> Room:
    """Return what leaves least room at a place: an obstacle or edge, else what was not seen."""
    lasting, margins = max(_lasting(place, maps, passage)), maps[passage].margins
    if lasting.short_m > 0.0:
        return lasting
    unseen_m = maps.map.middles_m(np.argwhere(maps[Passage.TIGHT].unknown()))
    hidden_m, lanes_m = maps.recent.assumed_m, maps.map.lanes_m
    return max(
        lasting,
        _near(place, outlines_m(maps.map.movers), margins.touch_m, "a mover"),
        _near(place, unseen_m, margins.unknown_m, "ground that was never seen"),
        _near(place, hidden_m, margins.doubt_m, "an obstacle whose base was not seen"),
        _near(place, lanes_m, margins.lane_m, "the path of a mover"),
    )


def _lasting(place: Place, maps: ClearanceMaps, passage: Passage) -> Iterator[Room]:
    found, margins = maps.map, maps[passage].margins
    points_m, touch_m = np.vstack([found.obstacles_m, maps.recent.seen_m]), margins.touch_m
    for item in found.objects:
        x_m, y_m = Pose2D(x_m=item.x_m, y_m=item.y_m, yaw_rad=item.yaw_rad).to_body(*place)
        base = Footprint(x_m=0.0, y_m=0.0, half_x_m=item.size_m / 2, half_y_m=item.width_m / 2)
        name = f"{found.classes.names[item.class_id]}{f' (object:{item.id})' if item.id else ''}"
        yield Room(touch_m - base.distance_m(x_m, y_m), touch_m, name)
        points_m = points_m[~covered(item, points_m, _OWN_M)]
    yield _near(place, points_m, touch_m, "an obstacle")
    outside_m = found.middles_m(np.argwhere(found.outside))
    edges_m = np.vstack([found.edges_m, maps.recent.edges_m, outside_m])
    yield _near(place, edges_m, margins.edge_m, EDGE)


def _near(place: Place, points_m: Floats, needed_m: float, what: str) -> Room:
    apart_m = float(np.hypot(*(points_m - place).T).min(initial=np.inf))
    return Room(needed_m - apart_m, needed_m, what)


def covered(item: MapObject, points_m: Floats, margin_m: float) -> Flags:
    """Return which points, (..., 2), lie on an object's base or within a margin around it."""
    middle = Pose2D(x_m=item.x_m, y_m=item.y_m, yaw_rad=item.yaw_rad)
    half_m = np.array([item.size_m, item.width_m]) / 2 + margin_m
    return np.asarray((np.abs(middle.points_to_body(points_m)) <= half_m).all(axis=-1))


def no_way(place: Place, maps: ClearanceMaps, *, arrive_m: float) -> str:
    """Return why no route ends within `arrive_m` of a place."""
    widest = maps[Passage.OUT]
    if maps.map.is_beyond_edge(*place):
        return BEYOND
    ends_m = widest.map.middles_m(np.argwhere(widest.open))
    if (np.hypot(*(ends_m - place).T) <= arrive_m).any():
        return _blocked(place, maps, arrive_m)
    known = max(_lasting(place, maps, Passage.OUT)).short_m > 0.0
    seen = maps.map.lies_on(maps[Passage.TIGHT].free, np.array(place))
    return no_room(place, maps) if known or seen else "the place was never seen"


def no_room(place: Place, maps: ClearanceMaps) -> str:
    """Return what leaves too little room at a place that no route or last step reaches."""
    rooms = [room_at(place, maps, each) for each in (Passage.OUT, Passage.TIGHT)]
    short = next((str(each) for each in rooms if each.short_m > 0.0), None)
    return f"no room at the place: {short or f'{rooms[0]} and the rounding of the map'}"


def _blocked(place: Place, maps: ClearanceMaps, arrive_m: float) -> str:
    """Return where the widest way to a place is too narrow."""
    found, grid = maps.map, maps[Passage.TIGHT]
    clear_m = np.where(grid.obstacle_m < found.cell_m, _SOLID_M, grid.clear_m)
    clear_m = np.clip(clear_m, _SOLID_M, np.where(grid.free, grid.margins.touch_m, _UNSEEN_M))
    crossed = ~found.outside
    crossed[grid.start] = True
    paths = fastest_paths(crossed, clear_m**-_POWER, grid.start)
    cells = np.stack(np.divmod(paths.reached, clear_m.shape[1]), axis=-1)
    apart_m = np.hypot(*(found.middles_m(cells) - place).T)
    ends = np.where(apart_m <= arrive_m, clear_m[tuple(cells.T)], -apart_m)  # the widest one there
    row, column = cells[ends.argmax()].tolist()
    spot = min(paths.to((row, column)), key=lambda cell: float(clear_m[cell]))
    x_m, y_m = found.middles_m(np.array(spot)).tolist()
    at, room = start_place(found, x_m, y_m), room_at((x_m, y_m), maps)
    if clear_m[spot] == _SOLID_M:
        return f"no known way: {room.what} is in between, at {at}"
    if not grid.free[spot]:
        return f"no known way: the ground at {at} was never seen"
    return f"no known way is wide enough: at {at} {room}"
