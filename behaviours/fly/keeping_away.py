"""Keeping away: giving way to movers, and a distance from obstacles and edges.

Distances are metres from the body's centre. Half of the body's diagonal is 0.2 m. The numbers were
chosen in flights on the training scenes and among movers in the twin.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from behaviours.path.clearance import ClearanceMap
from behaviours.path.margins import Margins
from behaviours.path.movers import TIMES_S, gap_m, is_of_movers, runs_into
from behaviours.path.nearby import near_first, recent_obstacles, sides_m
from uav_bt.types import NearObstacles, Velocity, clamp, rotate, rotate_points
from uav_bt.types.arrays import Floats
from uav_bt.types.dead_reckoning import MotionEstimate
from uav_bt.types.site_map import MapMover, SiteMap

# Distances from standing obstacles and edges. Obstacles may be slightly nearer than on a route.
# Edges may not: the drone also flies backwards and sideways, where an edge may be out of view.
MARGINS: Final = Margins(touch_m=0.38, min_start_m=0.38, edge_m=0.4)

_STAYS: Final = np.zeros(2)  # velocity of a drone that stays
_DIRECTIONS: Final = 24  # of ways out
_SPEEDS_MPS: Final = np.array([0.3, 0.6])
_REACTION_S: Final = 0.4  # from a decision to its effect
_FURTHEST_M: Final = 1.2  # length of the longest way
_BRAKE_MPS2: Final = 0.8  # deceleration that the drone can rely on
_ENOUGH_M: Final = 0.5  # gaps wider than this count as equal
_PER_M: Final = 0.08  # least gain in gap per metre flown
_KEPT_M: Final = 0.1  # bonus in gap for the present direction

_IN_VIEW_RAD: Final = math.radians(12)  # a mover within this bearing counts as in view
_WATCH_PER_S: Final = 1.5  # yaw rate per radian of that bearing
_WATCH_RADPS: Final = 1.2  # highest yaw rate
_STALE_S: Final = 0.8  # the drone stops when there was no new view for this time
# A mover that was not seen for this time may be an obstacle whose base is below the view.
_LOST_S: Final = 0.5
# Assumed range of such an obstacle. Nearer bases are below the view of a camera that looks 30
# degrees down from 1.5 m.
_HIDDEN_M: Final = 0.9
_HIDDEN_RAD: Final = math.radians(60)  # half angle ahead in which such obstacles count
_MIN_BEARINGS: Final = 2  # fewer are specks of the class map

_INTRUSION_M: Final = 0.38  # the drone steps away from an obstacle nearer than this
ROOM_STEP_M: Final = 0.15  # length of that step
# While it turns or flies on, the drone is pushed away from obstacles nearer than this. The push
# grows as the distance shrinks.
KEEP_AWAY_M: Final = 0.45
_EDGE_NEARER_M: Final = 0.15  # the edge of the ground may be nearer than an obstacle by this
PUSH_PER_S: Final = 1.5  # speed of the push per metre of intrusion
PUSH_MPS: Final = 0.2  # highest speed of the push
_ALIKE_M: Final = 0.25  # points within this distance of each other belong to one obstacle
_GAP_PUSH_MPS: Final = 0.1  # the same in a gap, of which the view may show one side only
_CENTRE_PER_S: Final = 1.2  # speed to the middle of a gap per metre
_BESIDE_M: Final = 0.3  # points this far ahead and behind are beside the drone
_LEAST: Final = 3  # as many are one side of a gap; fewer may be errors of views
_MIN_RANGE_M: Final = 0.05  # smaller ranges count as this, to avoid a division by zero


def by_the_map(
    obstacles: NearObstacles | None, site_map: SiteMap | None, *, in_gap: bool = False
) -> NearObstacles | None:
    """Return the obstacles near the drone, placed by the map if it has them.

    Recent points are placed by dead reckoning and drift. The map is matched to every view. In a gap
    of a few centimetres more than the hull, what was seen lately is more exact, and comes first. A
    map that views contradict is not used.
    """
    if obstacles is None or site_map is None or site_map.contradicted_s > 0.0:
        return obstacles
    pose = site_map.pose
    lately = recent_obstacles(obstacles.within(KEEP_AWAY_M + _ALIKE_M), site_map)
    if in_gap:
        points_m = near_first(site_map).obstacles_m
    else:  # without their outlines, the push could lead into the unseen sides of objects
        beside_m = sides_m(site_map, KEEP_AWAY_M)
        points_m = np.vstack([site_map.obstacles_m, beside_m, lately.seen_m])
    edges_m = np.vstack([site_map.edges_m, lately.edges_m])
    return NearObstacles(
        points_m=pose.points_to_body(points_m),
        edges_m=pose.points_to_body(edges_m),
        captured_s=obstacles.captured_s,
    ).within(KEEP_AWAY_M)


def step_away_m(obstacles: NearObstacles | None, edge_m: float) -> tuple[float, float] | None:
    """Return a step away from an obstacle that is too near, forward and right, metres.

    None if nothing is, or if the step led too near to something else or to an edge (`edge_m`).
    """
    if obstacles is None or obstacles.nearest_m >= _INTRUSION_M:
        return None
    distances = np.hypot(obstacles.points_m[:, 0], obstacles.points_m[:, 1])
    forward_m, right_m = obstacles.points_m[distances.argmin()]
    away = -ROOM_STEP_M / max(obstacles.nearest_m, _MIN_RANGE_M)
    forward_m, right_m = float(away * forward_m), float(away * right_m)
    if not obstacles.allows(forward_m, right_m, margin_m=_INTRUSION_M):
        return None
    if (np.linalg.norm(obstacles.edges_m - (forward_m, right_m), axis=1) < edge_m).any():
        return None
    return forward_m, right_m


def push_away_mps(obstacles: NearObstacles | None, *, in_gap: bool = False) -> tuple[float, float]:
    """Return the velocity away from what is too near, forward and right, m/s.

    In a gap it leads to the middle between its sides.
    """
    if obstacles is None:
        return 0.0, 0.0
    points_m = np.vstack([obstacles.points_m, obstacles.edges_m])
    ranges_m = np.maximum(np.linalg.norm(points_m, axis=1), _MIN_RANGE_M)
    gap_m = ranges_m.copy()
    gap_m[len(obstacles.points_m) :] += _EDGE_NEARER_M
    weights = np.clip(KEEP_AWAY_M / gap_m - 1.0, 0.0, None)
    if not weights.any():
        return 0.0, 0.0
    most_mps = _GAP_PUSH_MPS if in_gap else PUSH_MPS
    speed_mps = min(PUSH_PER_S * (KEEP_AWAY_M - float(gap_m.min())), most_mps)
    forward_mps, right_mps = -speed_mps * (weights / ranges_m) @ points_m / weights.sum()
    if not in_gap:
        return float(forward_mps), float(right_mps)
    beside_m = obstacles.points_m[np.abs(obstacles.points_m[:, 0]) < _BESIDE_M, 1]
    both_m = [np.sort(each[each > 0.0]) for each in (-beside_m, beside_m)]
    if all(len(each) >= _LEAST and each[_LEAST - 1] < KEEP_AWAY_M for each in both_m):
        left_m, right_m = (float(each[_LEAST - 1]) for each in both_m)
        right_mps = clamp(_CENTRE_PER_S * (right_m - left_m) / 2, PUSH_MPS)
    return float(forward_mps), float(right_mps)


class WayOut(NamedTuple):
    """The velocity of a straight way out, in the map's frame; 0 to stay."""

    x_mps: float = 0.0
    y_mps: float = 0.0


class GivingWay:
    """Decides on each new map whether the drone gives way, and in which direction."""

    def __init__(self, margins: Margins, body_m: float) -> None:
        self._margins, self._body_m = margins, body_m  # `body_m`: half of the body's diagonal
        self._decided_s = -math.inf  # capture time of the map of the last decision
        self._way: WayOut | None = None

    def velocity(
        self,
        site_map: SiteMap | None,
        obstacles: NearObstacles | None,
        motion: MotionEstimate | None,
        *,
        now_s: float,
    ) -> Velocity | None:
        """Return the velocity that gives way, in the body frame; None when nothing is too near."""
        if site_map is None or not site_map.movers:
            self._way = None
            return None
        site_map = _with_hidden(site_map, obstacles)
        stale = now_s - self._decided_s > _STALE_S
        if site_map.captured_s > self._decided_s:
            before = None if stale else self._way  # an older way is not being flown
            self._decided_s = site_map.captured_s
            self._way = self._decide(site_map, obstacles, motion, before)
        elif stale and (self._way is not None or runs_into(site_map, _STAYS, self._body_m)):
            self._way = WayOut()  # the way may end where no new view has shown it
        if self._way is None:
            return None
        (way_mps,) = rotate_points(np.array([self._way]), -site_map.pose.yaw_rad)
        ahead_mps, right_mps, turn_radps = *map(float, way_mps), _watching_radps(site_map)
        return Velocity(forward_mps=ahead_mps, right_mps=right_mps, yaw_rate_radps=turn_radps)

    def _decide(
        self,
        site_map: SiteMap,
        obstacles: NearObstacles | None,
        motion: MotionEstimate | None,
        before: WayOut | None,
    ) -> WayOut | None:
        if runs_into(site_map, _STAYS, self._body_m):
            recent = recent_obstacles(obstacles, site_map)
            standing_m = recent.seen_m[~is_of_movers(site_map.movers, recent.seen_m)]
            recent = replace(recent, seen_m=standing_m)
            standing = replace(site_map, movers=(), lanes_m=np.empty((0, 2)))
            clearance = ClearanceMap(standing, recent, self._margins)
            return way_out(clearance, site_map.movers, self._body_m, before=before)
        if motion is None:
            return None
        body_mps = np.array([[motion.velocity.forward_mps, motion.velocity.right_mps]])
        (over_ground_mps,) = rotate_points(body_mps, site_map.pose.yaw_rad)
        return WayOut() if runs_into(site_map, over_ground_mps, self._body_m) else None


def _with_hidden(site_map: SiteMap, obstacles: NearObstacles | None) -> SiteMap:
    """Return the map with lost movers at obstacles below the view, coming towards the drone."""
    if obstacles is None or obstacles.unplaced_within(_HIDDEN_RAD) < _MIN_BEARINGS:
        return site_map
    ahead_rad = obstacles.unplaced_rad[np.abs(obstacles.unplaced_rad) < _HIDDEN_RAD]
    bearing_rad = float(np.median(ahead_rad))
    pose = site_map.pose
    ux, uy = rotate(math.cos(bearing_rad), math.sin(bearing_rad), pose.yaw_rad)
    x_m, y_m, movers = pose.x_m + _HIDDEN_M * ux, pose.y_m + _HIDDEN_M * uy, list(site_map.movers)
    for place, each in enumerate(movers):
        if site_map.captured_s - each.seen_s > _LOST_S:
            x_mps, y_mps = -each.std_mps * ux, -each.std_mps * uy
            exact = replace(each, std_m=0.0, std_mps=0.0)
            movers[place] = replace(exact, x_m=x_m, y_m=y_m, x_mps=x_mps, y_mps=y_mps)
    return replace(site_map, movers=tuple(movers))


def _watching_radps(site_map: SiteMap) -> float:
    """Return the yaw rate that keeps the nearest mover in view."""
    places_m = [site_map.pose.to_body(mover.x_m, mover.y_m) for mover in site_map.movers]
    forward_m, right_m = min(places_m, key=lambda place_m: math.hypot(*place_m))
    bearing_rad = math.atan2(right_m, forward_m)
    seen = abs(bearing_rad) < _IN_VIEW_RAD
    return 0.0 if seen else clamp(_WATCH_PER_S * bearing_rad, _WATCH_RADPS)


def way_out(
    clearance: ClearanceMap,
    movers: Sequence[MapMover],
    body_m: float,
    *,
    before: WayOut | None = None,
) -> WayOut:
    """Return the velocity that leaves the widest gap to movers; 0 to stay.

    The way leads over ground that was seen, with clearance to standing obstacles. The drone can
    stop before it ends. `before` is the way that is being flown.
    """
    pose = clearance.map.pose
    here_m = np.array([pose.x_m, pose.y_m])
    azimuths = np.arange(_DIRECTIONS) * 2.0 * math.pi / _DIRECTIONS
    headings = np.stack([np.cos(azimuths), np.sin(azimuths)], axis=-1)
    reaches_m = _open_m(clearance, here_m, headings)
    flown_m = _SPEEDS_MPS[:, None] * np.maximum(TIMES_S - _REACTION_S, 0.0)
    stops_m = _SPEEDS_MPS * _REACTION_S + _SPEEDS_MPS**2 / (2.0 * _BRAKE_MPS2)
    reaches_m = np.maximum(reaches_m[:, None] - stops_m, 0.0)  # (directions, speeds)
    flown_m = np.minimum(flown_m, reaches_m[..., None])  # (directions, speeds, T)
    left_m = gap_m(movers, here_m + flown_m[..., None] * headings[:, None, None], body_m)
    worth = np.minimum(left_m, _ENOUGH_M) - _PER_M * flown_m[..., -1]
    if before is not None and math.hypot(*before) > 0.0:
        worth += _KEPT_M * np.cos(azimuths - math.atan2(before.y_mps, before.x_mps))[:, None]
    worth[reaches_m <= 0.0] = -np.inf
    stays_m = float(gap_m(movers, np.broadcast_to(here_m, (len(TIMES_S), 2)), body_m))
    direction, speed = np.unravel_index(int(worth.argmax()), worth.shape)
    if worth[direction, speed] <= min(stays_m, _ENOUGH_M):
        return WayOut()
    return WayOut(*map(float, _SPEEDS_MPS[speed] * headings[direction]))


def _open_m(clearance: ClearanceMap, here_m: Floats, headings: Floats) -> Floats:
    """Return the open distance along each heading, metres, (D,)."""
    found = clearance.map
    ranges_m = np.arange(found.cell_m, _FURTHEST_M + found.cell_m / 2, found.cell_m)
    places_m = here_m + ranges_m[:, None] * headings[:, None]
    cells = np.floor((places_m - found.corner_m) / found.cell_m + 0.5).astype(int)
    inside = np.asarray(((cells >= 0) & (cells < found.free.shape)).all(axis=-1))
    rows, columns = np.moveaxis(np.where(np.expand_dims(inside, -1), cells, 0), -1, 0)
    # The map also counts the cells around the drone as free. A drone that evades again and again
    # carries them along, beyond an edge that it has not seen.
    is_flyable = np.logical_and(clearance.open, found.ground)
    is_open = np.logical_and(inside, is_flyable[rows, columns])
    return np.asarray(found.cell_m * np.logical_and.accumulate(is_open, axis=1).sum(axis=1))
