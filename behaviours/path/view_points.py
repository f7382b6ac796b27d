"""View points: places around an object from which a drone sees it and has room."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from behaviours.path.clearance import ClearanceMap
from behaviours.path.margins import Passage
from behaviours.path.passages import ClearanceMaps
from uav_bt.types import Pose2D
from uav_bt.types.arrays import Flags, Floats
from uav_bt.types.site_map import MapObject, SiteMap

_LEAST: Final = 1e-9  # of a sine or cosine, so that no division overflows


@dataclass(frozen=True, kw_only=True)
class ViewPointConfig:
    """Where view points are tried. All numbers were chosen.

    Attributes:
        turn_rad: Angle between two bearings that are tried.
        spread: Share of half the angle between two wanted places up to which bearings are tried.
        scales: Multiples of the wanted distance that are tried, in the order of preference.
        scale_rad: Turn that is preferred to a further step in `scales`.
        own_m: Obstacle points this near to the base of the target belong to it.
        sight_m: A line of sight keeps this distance from other obstacle points.
        step_m: Distance between the samples of a line of sight.
    """

    turn_rad: float = math.radians(5)
    spread: float = 0.75
    scales: tuple[float, ...] = (1.0, 1.1, 0.9, 1.2, 0.8)
    scale_rad: float = math.radians(15)
    own_m: float = 0.2
    sight_m: float = 0.1
    step_m: float = 0.05


def view_points(
    maps: ClearanceMaps,
    target: MapObject,
    *,
    distance_m: float,
    count: int,
    config: ViewPointConfig | None = None,
) -> list[Pose2D]:
    """Return poses that face an object, evenly spread around it, in the order of a tour.

    Each pose can be reached, keeps the ordinary margins, and has a free line of sight. Where the
    wanted place has none, one beside it is taken.

    Args:
        maps: Clearance maps of the newest site map.
        target: The object. Another place is an object without a size.
        distance_m: Distance from the object's side to the pose, along the line of sight.
        count: Wanted number of poses.
        config: Where poses are tried.

    Returns:
        Poses in the map's frame, `count` or fewer. The first one is the nearest to fly to, and each
        is followed by the nearest one that is left.
    """
    config = config or ViewPointConfig()
    turns_rad, distances_m = _candidates(distance_m, count, config)
    middles_rad = _first_rad(target, maps.map.pose) + math.tau * np.arange(count) / count
    bearings_rad = middles_rad[:, None] + turns_rad
    directions = np.stack([np.cos(bearings_rad), np.sin(bearings_rad)], axis=-1)
    sides_m = np.array([target.x_m, target.y_m]) + directions * _reach_m(target, bearings_rad)
    places_m = sides_m + directions * distances_m[:, None]
    time_s = _time_s(maps, places_m)
    usable = np.isfinite(time_s) & _has_room(maps[Passage.ORDINARY], places_m)
    usable[usable] = _in_sight(maps.map, target, places_m[usable], sides_m[usable], config)
    best = usable.argmax(axis=1)  # the first usable candidate of each bearing
    chosen = np.flatnonzero(usable.any(axis=1))
    poses = [
        Pose2D(
            x_m=float(places_m[row, best[row], 0]),
            y_m=float(places_m[row, best[row], 1]),
            yaw_rad=math.remainder(float(bearings_rad[row, best[row]]) + math.pi, math.tau),
        )
        for row in chosen
    ]
    return _tour(poses, [float(time_s[row, best[row]]) for row in chosen])


def _candidates(distance_m: float, count: int, config: ViewPointConfig) -> tuple[Floats, Floats]:
    """Return the places that are tried instead of a wanted one, the best first.

    Returns:
        (K,) turns of the bearing, and (K,) distances from the object's side.
    """
    steps = math.floor(config.spread * math.pi / count / config.turn_rad)
    turns_rad = config.turn_rad * np.arange(-steps, steps + 1)
    cost = np.abs(turns_rad)[:, None] + config.scale_rad * np.arange(len(config.scales))
    turn, scale = np.unravel_index(np.argsort(cost, axis=None, kind="stable"), cost.shape)
    return np.asarray(turns_rad[turn]), distance_m * np.array(config.scales)[scale]


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
    """Return the time to fly to each place through the widest passage that leads to any."""
    time_s = np.full(places_m.shape[:-1], math.inf)
    for passage in Passage:
        times = maps[passage].fastest.time_s
        cells = _cells(maps.map, places_m)
        inside = ((cells >= 0) & (cells < times.shape)).all(axis=-1)
        time_s[inside] = times[tuple(cells[inside].T)]
        if np.isfinite(time_s).any():
            break
    return time_s


def _has_room(clearance: ClearanceMap, places_m: Floats) -> Flags:
    """Return which places keep the margins, wherever they lie in their cells."""
    room_m = clearance.margins.touch_m + clearance.map.cell_m / 2
    return clearance.map.lies_on(clearance.open & (clearance.clear_m >= room_m), places_m)


def _in_sight(
    site_map: SiteMap,
    target: MapObject,
    places_m: Floats,
    sides_m: Floats,
    config: ViewPointConfig,
) -> Flags:
    """Return which places see the side of an object before them, (N,).

    Args:
        site_map: The newest map.
        target: The object.
        places_m: (N, 2) places.
        sides_m: (N, 2) points of its outline before them.
        config: Distances.
    """
    if not len(places_m):
        return np.zeros(0, dtype=bool)
    own = _covered(target, site_map.obstacles_m, config.own_m)
    others_m = site_map.obstacles_m[~own]
    longest_m = float(np.hypot(*(sides_m - places_m).T).max())
    shares = np.linspace(0.0, 1.0, max(2, math.ceil(longest_m / config.step_m)))[:, None]
    lines_m = places_m[:, None] + shares * (sides_m - places_m)[:, None]  # (N, S, 2)
    blocked = np.zeros(lines_m.shape[:2], dtype=bool)
    for item in site_map.objects:
        is_target = target.covers(item.x_m, item.y_m) or item.covers(target.x_m, target.y_m)
        if not is_target:
            blocked |= _covered(item, lines_m, 0.0)
    for point_m in others_m:
        blocked |= np.hypot(*np.moveaxis(lines_m - point_m, -1, 0)) < config.sight_m
    return np.asarray(~blocked.any(axis=1))


def _covered(item: MapObject, points_m: Floats, margin_m: float) -> Flags:
    """Return which points, (..., 2), lie on an object's base or within a margin around it."""
    middle = Pose2D(x_m=item.x_m, y_m=item.y_m, yaw_rad=item.yaw_rad)
    half_m = np.array([item.size_m, item.width_m]) / 2 + margin_m
    return np.asarray((np.abs(middle.points_to_body(points_m)) <= half_m).all(axis=-1))


def _cells(site_map: SiteMap, places_m: Floats) -> np.ndarray[tuple[int, ...], np.dtype[np.intp]]:
    steps = (places_m - np.array(site_map.corner_m)) / site_map.cell_m
    return np.asarray(np.rint(steps).astype(np.intp))


def _tour(poses: list[Pose2D], time_s: list[float]) -> list[Pose2D]:
    """Return the poses in the order of a tour, from the one that is reached first.

    Args:
        poses: The poses.
        time_s: Time to fly to each.
    """
    if not poses:
        return []
    first = int(np.argmin(time_s))
    tour, left = [poses[first]], poses[:first] + poses[first + 1 :]
    while left:
        here = tour[-1]
        apart_m = [round(math.dist((here.x_m, here.y_m), (it.x_m, it.y_m)), 2) for it in left]
        tour.append(left.pop(int(np.argmin(apart_m))))
    return tour
