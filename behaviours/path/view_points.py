"""View points: places around an object from which a drone sees it and has room."""

from __future__ import annotations

import math
from collections import Counter
from typing import Final

import numpy as np

from behaviours.path.margins import Passage
from behaviours.path.passages import ClearanceMaps
from behaviours.path.room import BEYOND, Room, covered, room_at
from uav_bt.types import Pose2D
from uav_bt.types.arrays import Flags, Floats
from uav_bt.types.site_map import MapObject, SiteMap

# All numbers were chosen.
_TURN_RAD: Final = math.radians(5)  # between two bearings that are tried
# Share of half the angle between two wanted places up to which bearings are tried.
_SPREAD: Final = 0.75
_SCALES: Final = (1.0, 1.1, 0.9, 1.2, 0.8)  # of the wanted distance, in the order of preference
_SCALE_RAD: Final = math.radians(15)  # a turn that is preferred to a further step in `_SCALES`
_OWN_M: Final = 0.2  # obstacle points this near to the base of the target belong to it
SIGHT_M: Final = 0.1  # a line of sight keeps this distance from other obstacle points
_STEP_M: Final = 0.05  # between the samples of a line of sight
_LEAST: Final = 1e-9  # of a sine or cosine, so that no division overflows


def view_points(
    maps: ClearanceMaps, target: MapObject, *, distance_m: float, count: int
) -> list[Pose2D]:
    """Return poses that face an object, evenly spread around it, in the order of a tour.

    Each pose can be reached, keeps the ordinary margins, and has a free line of sight. Where the
    wanted place has none, one beside it is taken.

    Args:
        maps: Clearance maps of the newest site map.
        target: The object. Another place is an object without a size.
        distance_m: Distance from the object's side to the pose, along the line of sight.
        count: Wanted number of poses.

    Returns:
        Poses in the map's frame, `count` or fewer. The first one is the nearest to fly to, and each
        is followed by the nearest one that is left.
    """
    # (K,) turns and distances that are tried for each wanted bearing, the best first
    steps = math.floor(_SPREAD * math.pi / count / _TURN_RAD)
    turns_rad = _TURN_RAD * np.arange(-steps, steps + 1)
    cost = np.abs(turns_rad)[:, None] + _SCALE_RAD * np.arange(len(_SCALES))
    turn, scale = np.unravel_index(np.argsort(cost, axis=None, kind="stable"), cost.shape)
    distances_m = distance_m * np.array(_SCALES)[scale]
    middles_rad = _first_rad(target, maps.map.pose) + math.tau * np.arange(count) / count
    bearings_rad = middles_rad[:, None] + turns_rad[turn]
    directions = np.stack([np.cos(bearings_rad), np.sin(bearings_rad)], axis=-1)
    sides_m = np.array([target.x_m, target.y_m]) + directions * _reach_m(target, bearings_rad)
    places_m = sides_m + directions * distances_m[:, None]
    time_s, ordinary = _time_s(maps, places_m), maps[Passage.ORDINARY]
    # Room wherever the place lies in its cell.
    room_m = ordinary.margins.touch_m + maps.map.cell_m / 2
    roomy = maps.map.lies_on(ordinary.open & (ordinary.clear_m >= room_m), places_m)
    usable = np.isfinite(time_s) & roomy
    usable[usable] = _in_sight(maps.map, target, places_m[usable], sides_m[usable])
    chosen = np.flatnonzero(usable.any(axis=1))
    best = chosen, usable.argmax(axis=1)[chosen]  # the first usable candidate of each bearing
    poses = [
        Pose2D(
            x_m=float(x_m), y_m=float(y_m), yaw_rad=math.remainder(float(rad) + math.pi, math.tau)
        )
        for (x_m, y_m), rad in zip(places_m[best], bearings_rad[best], strict=True)
    ]
    return _tour(poses, time_s[best])


def why_none(maps: ClearanceMaps, target: MapObject, *, distance_m: float, count: int) -> str:
    """Return what the wanted places around an object lack; the two most frequent reasons."""
    reasons, rounding_m = Counter[str](), maps.map.cell_m / 2
    for rad in _first_rad(target, maps.map.pose) + math.tau * np.arange(count) / count:
        out_m = distance_m + float(_reach_m(target, rad)[0])
        place = target.x_m + out_m * math.cos(rad), target.y_m + out_m * math.sin(rad)
        short_m, needed_m, what = room_at(place, maps, Passage.ORDINARY)
        room = Room(short_m + rounding_m, needed_m + rounding_m, what)
        hidden = str(room) if room.short_m > 0.0 else "no free view, or no known way there"
        reasons[BEYOND if maps.map.is_beyond_edge(*place) else hidden] += 1
    return "; ".join(f"{number} of {count}: {text}" for text, number in reasons.most_common(2))


def _first_rad(target: MapObject, pose: Pose2D) -> float:
    """Return the bearing, from an object, of the normal of the side that faces the drone."""
    to_drone_rad = math.atan2(pose.y_m - target.y_m, pose.x_m - target.x_m)
    if target.size_m == 0.0:
        return to_drone_rad
    quarters = round((to_drone_rad - target.yaw_rad) / (math.pi / 2))
    return target.yaw_rad + quarters * math.pi / 2


def _reach_m(target: MapObject, bearings_rad: Floats) -> Floats:
    """Return the distances from the middle of a base to its outline, (..., 1)."""
    along, across = np.cos(bearings_rad - target.yaw_rad), np.sin(bearings_rad - target.yaw_rad)
    to_ends_m = target.size_m / 2 / np.maximum(np.abs(along), _LEAST)
    to_sides_m = target.width_m / 2 / np.maximum(np.abs(across), _LEAST)
    return np.asarray(np.minimum(to_ends_m, to_sides_m)[..., None])


def _time_s(maps: ClearanceMaps, places_m: Floats) -> Floats:
    """Return the time to fly to each place through the widest usable passage that leads to any."""
    time_s = np.full(places_m.shape[:-1], math.inf)
    steps = (places_m - np.array(maps.map.corner_m)) / maps.map.cell_m
    cells = np.rint(steps).astype(np.intp)
    inside = ((cells >= 0) & (cells < maps.map.seen_s.shape)).all(axis=-1)
    for passage in Passage:
        time_s[inside] = maps[passage].fastest.time_s[tuple(cells[inside].T)]
        if np.isfinite(time_s).any():
            break
    return time_s


def _in_sight(site_map: SiteMap, target: MapObject, places_m: Floats, sides_m: Floats) -> Flags:
    """Return which places, (N, 2), see the points of an object's outline before them, (N, 2)."""
    if not len(places_m):
        return np.zeros(0, dtype=bool)
    longest_m = float(np.hypot(*(sides_m - places_m).T).max())
    shares = np.linspace(0.0, 1.0, max(2, math.ceil(longest_m / _STEP_M)))[:, None]
    lines_m = places_m[:, None] + shares * (sides_m - places_m)[:, None]  # (N, S, 2)
    blocked = np.zeros(lines_m.shape[:2], dtype=bool)
    for item in site_map.objects:
        is_target = target.covers(item.x_m, item.y_m) or item.covers(target.x_m, target.y_m)
        if not is_target:
            blocked |= covered(item, lines_m, 0.0)
    for point_m in site_map.obstacles_m[~covered(target, site_map.obstacles_m, _OWN_M)]:
        blocked |= np.hypot(*np.moveaxis(lines_m - point_m, -1, 0)) < SIGHT_M
    return np.asarray(~blocked.any(axis=1))


def _tour(poses: list[Pose2D], time_s: Floats) -> list[Pose2D]:
    """Return poses, with the time to fly to each, in the order of a tour, the nearest first."""
    if not poses:
        return []
    first = int(np.argmin(time_s))
    tour, left = [poses[first]], poses[:first] + poses[first + 1 :]
    while left:
        here = tour[-1]
        apart_m = [round(math.dist((here.x_m, here.y_m), (it.x_m, it.y_m)), 2) for it in left]
        tour.append(left.pop(int(np.argmin(apart_m))))
    return tour
