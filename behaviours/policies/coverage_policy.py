"""Coverage policy: fly the route over the site map that covers the most new ground per second."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final

import numpy as np

from behaviours.path.clearance import ClearanceMap, Route
from behaviours.path.following import UNMAPPED_S, follow
from behaviours.path.gimbal_pointing import ENOUGH_GROUND, LITTLE_GROUND, ground_share
from behaviours.path.margins import Margins, Passage
from behaviours.path.nearby import recent_obstacles
from behaviours.path.passages import ClearanceMaps
from behaviours.path.survey import best_route
from uav_bt.answers import Answer, Blocked, Done, Rotate
from uav_bt.errors import MissionError
from uav_bt.protocols import PolicyView
from uav_bt.types.site_map import SiteMap

# The numbers were chosen in surveys of the training scenes.
_LITTLE_M2PS: Final = 0.03  # tight routes are tried below this rate of new ground on ordinary ones
_TURN_RAD: Final = math.radians(30)  # turn for another view when no route is known
_DOUBTED_S: Final = 1.0  # a map that the views contradict for longer than this is not used
# The drone turns towards the ground after this time without ground in view, because its drift is
# not measured meanwhile. An ordinary turn over the outside takes less.
_BLIND_S: Final = 2.0
# For at most this time where an obstacle hides the ground of the map: a turn takes less.
_BACK_S: Final = 5.0
_AROUND_M: Final = 2.0  # the drone turns towards the ground within this distance
_FACED_RAD: Final = math.radians(30)  # ground within this angle of the heading is looked at already
_LOOKS_RAD: Final = tuple(  # where else to look, the smallest turn first
    math.radians(side * angle) for angle in range(45, 181, 15) for side in (1, -1)
)


class CoveragePolicy:
    """The planner as a leaf policy."""

    def __init__(self) -> None:
        # Here and not at the top: see that module.
        import behaviours.path.compiled_loops  # noqa: F401, PLC0415

    def decide(self, view: PolicyView) -> Answer:
        """Return a heading and a speed; a turn when no way is known; done when all is covered."""
        site_map = view.site_map
        if site_map is None:
            raise MissionError(
                "policy 'coverage' flies by the map of the place, and none is on the board: put "
                "<Segment/>, <TrackMotion/> and <MapSite/> ahead of the leaves that fly"
            )
        if not site_map.ground.any():
            return _turn(view.turning, "no ground seen")
        if site_map.contradicted_s > _DOUBTED_S:
            return _turn(view.turning or _ground_rad(site_map), "the view contradicts the map")
        if site_map.untracked_s > _BLIND_S and _sees_little_ground(view, site_map):
            return Rotate(yaw_rad=_look_rad(view, site_map), reason="turns to the ground")
        margins = Margins().within(view.clearances)
        route, clearance = _route(site_map, margins)
        answer: Answer | None = None
        if route is not None:
            reason = f"{route.new_m2:.1f} m2 in {route.time_s:.0f} s"
            answer = follow(route, site_map, view.corridor, margins=margins, reason=reason)
        # Moving obstacles block ground only for a while.
        elif not site_map.movers and not len(site_map.lanes_m) and view.full_turns > 0:
            answer = None if clearance.shut_in else Done(reason="covered")
        return answer or _turn(view.turning or _ground_rad(site_map), "no way")


def _turn(side: float, reason: str) -> Blocked:
    """Return a turn for another view, clockwise for a side of 0 or more."""
    return Blocked(yaw_rad=math.copysign(_TURN_RAD, side or 1.0), reason=reason, free_m=0.0)


def _route(site_map: SiteMap, margins: Margins) -> tuple[Route | None, ClearanceMap]:
    """Return the best route through the widest passage with one, and the last map searched."""
    recent = recent_obstacles(site_map.near, site_map, unmapped_s=UNMAPPED_S)
    maps = ClearanceMaps(site_map, recent, margins)
    clearance = maps[Passage.ORDINARY]
    route = best_route(clearance)
    if route is None or route.new_m2 < _LITTLE_M2PS * route.time_s:
        clearance = maps[Passage.TIGHT]
        route = best_route(clearance) or route
    if route is None and (clearance.shut_in or clearance.too_narrow):
        clearance = maps[Passage.OUT]
        route = best_route(clearance)
    return route, clearance


def _sees_little_ground(view: PolicyView, site_map: SiteMap) -> bool:
    if site_map.captured_s - site_map.ground_s > _BLIND_S:
        return True
    height_m = view.height_above_ground_m
    shown = ground_share(site_map, view.camera, view.gimbal_pitch_rad, height_m)
    if site_map.untracked_s < _BLIND_S + _BACK_S:
        shown = min(shown, float(np.mean(view.class_map.is_ground)))
    return shown < LITTLE_GROUND


def _look_rad(view: PolicyView, site_map: SiteMap) -> float:
    """Return the bearing of the known ground, or of what may be ground if a view shows none there.

    In a corner the known ground is a patch ahead, which the drone saw as it looked out of the area.
    """

    def share(bearing_rad: float) -> float:
        pose = replace(site_map.pose, yaw_rad=site_map.pose.yaw_rad + bearing_rad)
        turned = replace(site_map, pose=pose)
        return ground_share(turned, view.camera, view.gimbal_pitch_rad, view.height_above_ground_m)

    ground_rad = _ground_rad(site_map)
    if abs(ground_rad) > _FACED_RAD and share(ground_rad) >= LITTLE_GROUND:
        return ground_rad
    shares = {bearing_rad: share(bearing_rad) for bearing_rad in _LOOKS_RAD}
    enough = [each for each in _LOOKS_RAD if shares[each] >= ENOUGH_GROUND]
    return enough[0] if enough else max(_LOOKS_RAD, key=shares.__getitem__)


def _ground_rad(site_map: SiteMap) -> float:
    """Return the bearing of the mean of the ground around the drone, or else of all ground."""
    pose, reach = site_map.pose, math.ceil(_AROUND_M / site_map.cell_m)
    first = np.maximum(np.array(site_map.cell_of(pose.x_m, pose.y_m)) - reach, 0)
    window = site_map.ground[first[0] :, first[1] :][: 2 * reach + 1, : 2 * reach + 1]
    places_m = pose.points_to_body(site_map.middles_m(np.argwhere(window) + first))
    near_m = places_m[np.hypot(*places_m.T) <= _AROUND_M]
    if not len(near_m):
        near_m = pose.points_to_body(site_map.middles_m(np.argwhere(site_map.ground)))
    forward_m, right_m = near_m.mean(axis=0)
    return math.atan2(right_m, forward_m)
