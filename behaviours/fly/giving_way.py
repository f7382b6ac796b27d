"""Giving way to movers: stop or get out of their way, and keep the nearest one in view.

The numbers were chosen in flights among movers in the twin.
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
from behaviours.path.nearby import recent_obstacles
from uav_bt.types import NearObstacles, Velocity, rotate, rotate_points
from uav_bt.types.arrays import Floats
from uav_bt.types.dead_reckoning import MotionEstimate
from uav_bt.types.site_map import MapMover, SiteMap

# Distances from standing obstacles and edges. Obstacles may be slightly nearer than on a route.
# Edges may not: the drone also flies backwards and sideways, where an edge may be out of view.
MARGINS: Final = Margins(touch_m=0.38, min_start_m=0.38, edge_m=0.4)

_DIRECTIONS: Final = 24  # of ways out
_SPEEDS_MPS: Final = np.array([0.3, 0.6])
_REACTION_S: Final = 0.4  # from a decision to its effect
_FURTHEST_M: Final = 1.2  # length of the longest way
_BRAKE_MPS2: Final = 0.8  # deceleration that the drone can rely on
_ENOUGH_M: Final = 0.5  # gaps wider than this count as equal
_PER_M: Final = 0.08  # least gain in gap per metre flown
_KEPT_M: Final = 0.1  # bonus in gap for the present direction

_IN_VIEW_RAD: Final = math.radians(12)  # a mover within this bearing counts as in view
CLIMB_PER_S: Final = 2.0  # climb rate per metre of error in height
CLIMB_MPS: Final = 0.5  # highest climb rate
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


class WayOut(NamedTuple):
    """The velocity of a straight way out, in the map's frame; 0 to stay."""

    x_mps: float = 0.0
    y_mps: float = 0.0


class GivingWay:
    """Decides on each new map whether the drone gives way, and in which direction.

    Args:
        margins: Distances from standing obstacles and edges.
        body_m: Half of the body's diagonal.
    """

    def __init__(self, margins: Margins, body_m: float) -> None:
        self._margins, self._body_m = margins, body_m
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
        """Return the velocity that gives way, in the body frame; None when nothing comes too near.

        Args:
            site_map: The newest map; None without one.
            obstacles: Obstacles seen around the drone.
            motion: The drone's motion over the ground.
            now_s: Time of the mission clock.
        """
        if site_map is None or not site_map.movers:
            self._way = None
            return None
        site_map = _with_hidden(site_map, obstacles)
        stale = now_s - self._decided_s > _STALE_S
        if site_map.captured_s > self._decided_s:
            before = None if stale else self._way  # an older way is not being flown
            self._decided_s = site_map.captured_s
            self._way = self._decide(site_map, obstacles, motion, before)
        elif stale and (self._way is not None or self._is_threatened(site_map)):
            self._way = WayOut()  # the way may end where no new view has shown it
        if self._way is None:
            return None
        ((forward_mps, right_mps),) = rotate_points(np.array([self._way]), -site_map.pose.yaw_rad)
        return Velocity(
            forward_mps=float(forward_mps),
            right_mps=float(right_mps),
            yaw_rate_radps=_watching_radps(site_map),
        )

    def _is_threatened(self, site_map: SiteMap) -> bool:
        return runs_into(site_map, np.zeros(2), self._body_m)

    def _decide(
        self,
        site_map: SiteMap,
        obstacles: NearObstacles | None,
        motion: MotionEstimate | None,
        before: WayOut | None,
    ) -> WayOut | None:
        if self._is_threatened(site_map):
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
    """Return the map with lost movers at an obstacle whose base is below the view.

    They are assumed to come towards the drone, which a step to the side evades.
    """
    if obstacles is None or obstacles.unplaced_within(_HIDDEN_RAD) < _MIN_BEARINGS:
        return site_map
    ahead_rad = obstacles.unplaced_rad[np.abs(obstacles.unplaced_rad) < _HIDDEN_RAD]
    bearing_rad = float(np.median(ahead_rad))
    pose = site_map.pose
    ux, uy = rotate(math.cos(bearing_rad), math.sin(bearing_rad), pose.yaw_rad)
    return replace(
        site_map,
        movers=tuple(
            replace(
                mover,
                x_m=pose.x_m + _HIDDEN_M * ux,
                y_m=pose.y_m + _HIDDEN_M * uy,
                x_mps=-mover.std_mps * ux,
                y_mps=-mover.std_mps * uy,
                std_m=0.0,
                std_mps=0.0,
            )
            if site_map.captured_s - mover.seen_s > _LOST_S
            else mover
            for mover in site_map.movers
        ),
    )


def _watching_radps(site_map: SiteMap) -> float:
    """Return the yaw rate that keeps the nearest mover in view."""
    places_m = [site_map.pose.to_body(mover.x_m, mover.y_m) for mover in site_map.movers]
    forward_m, right_m = min(places_m, key=lambda place_m: math.hypot(*place_m))
    bearing_rad = math.atan2(right_m, forward_m)
    if abs(bearing_rad) < _IN_VIEW_RAD:
        return 0.0
    return max(-_WATCH_RADPS, min(_WATCH_RADPS, _WATCH_PER_S * bearing_rad))


def way_out(
    clearance: ClearanceMap,
    movers: Sequence[MapMover],
    body_m: float,
    *,
    before: WayOut | None = None,
) -> WayOut:
    """Return the velocity that leaves the widest gap to movers; 0 to stay.

    The way leads over ground that was seen, with clearance. The drone can stop before it ends.

    Args:
        clearance: The clearance map of the standing obstacles.
        movers: The movers.
        body_m: Half of the body's diagonal.
        before: The way that is being flown; None without one.
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
