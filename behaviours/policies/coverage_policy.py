"""Coverage policy: fly the route over the site map that covers the most new ground per second."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from behaviours.path.following import FollowConfig, follow
from behaviours.path.gimbal_pointing import GimbalConfig, ground_share
from behaviours.path.margins import Margins, Passage
from behaviours.path.nearby import recent_obstacles
from behaviours.path.passages import ClearanceMaps
from behaviours.path.survey import SurveyConfig, best_route
from uav_bt.answers import Answer, Blocked, Done, Rotate
from uav_bt.errors import MissionError
from uav_bt.protocols import PolicyView
from uav_bt.types.site_map import SiteMap


@dataclass(frozen=True, kw_only=True)
class CoverageConfig:
    """How routes are chosen and flown. The numbers were chosen in surveys of the training scenes.

    Attributes:
        margins: Distances that routes keep.
        survey: Search and value of routes.
        little_m2ps: Tight routes are tried below this rate of new ground on ordinary routes, m2/s.
        turn_rad: Turn for another view when no route is known.
        doubted_s: The drone stops using a map that the views contradict for longer than this.
        blind_s: The drone turns towards the ground after this time without ground in view, because
            its drift is not measured meanwhile. An ordinary turn over the outside takes less.
        back_s: It does so for at most this time where an obstacle hides the ground of the map: a
            turn takes less, and perhaps no heading shows more ground.
        around_m: The drone turns towards the ground within this distance.
        follow: How routes are followed.
        pointing: Which ground counts as in view.
    """

    margins: Margins = field(default_factory=Margins)
    survey: SurveyConfig = field(default_factory=SurveyConfig)
    little_m2ps: float = 0.03
    turn_rad: float = math.radians(30)
    doubted_s: float = 1.0
    blind_s: float = 2.0
    back_s: float = 5.0
    around_m: float = 2.0
    follow: FollowConfig = field(default_factory=FollowConfig)
    pointing: GimbalConfig = field(default_factory=GimbalConfig)


class CoveragePolicy:
    """The planner as a leaf policy.

    Args:
        config: How routes are chosen and flown.
    """

    def __init__(self, config: CoverageConfig | None = None) -> None:
        # Here and not at the top: see that module.
        import behaviours.path.compiled_loops  # noqa: F401, PLC0415

        self.config = config or CoverageConfig()

    def decide(self, view: PolicyView) -> Answer:
        """Return a heading and a speed; a turn when no way is known; done when all is covered.

        Raises:
            MissionError: no map is on the board.
        """
        cfg, site_map = self.config, view.site_map
        if site_map is None:
            raise MissionError(
                "policy 'coverage' flies by the map of the place, and none is on the board: put "
                "<Segment/>, <TrackMotion/> and <MapSite/> ahead of the leaves that fly"
            )
        ground_rad = _ground_rad(site_map, cfg.around_m)
        turn = Blocked(
            yaw_rad=math.copysign(cfg.turn_rad, view.turning or ground_rad or 1.0),
            reason="no way",
            free_m=0.0,
        )
        if ground_rad is None:
            return replace(turn, reason="no ground seen")
        if site_map.contradicted_s > cfg.doubted_s:
            return replace(turn, reason="the view contradicts the map")
        if site_map.untracked_s > cfg.blind_s and self._sees_little_ground(view, site_map):
            return Rotate(yaw_rad=ground_rad, reason="turns to the ground")
        margins = cfg.margins.within(view.clearances)
        recent = recent_obstacles(site_map.near, site_map, unmapped_s=cfg.follow.unmapped_s)
        maps = ClearanceMaps(site_map, recent, margins, past_assumed=True)
        clearance = maps[Passage.ORDINARY]
        route = best_route(clearance, cfg.survey)
        if route is None or route.new_m2 < cfg.little_m2ps * route.time_s:
            clearance = maps[Passage.TIGHT]
            route = best_route(clearance, cfg.survey) or route
        if route is None and (clearance.shut_in or clearance.too_narrow):
            clearance = maps[Passage.TIGHTEST]
            if clearance.shut_in:
                clearance = maps[Passage.OUT]
            route = best_route(clearance, cfg.survey)
        if route is None:
            # Moving obstacles block ground only for a while.
            still = not site_map.movers and not len(site_map.lanes_m)
            covered = view.full_turns > 0 and not clearance.shut_in and still
            return Done(reason="covered") if covered else turn
        reason = f"{route.new_m2:.1f} m2 in {route.time_s:.0f} s"
        answer = follow(
            route,
            site_map,
            view.corridor,
            margins=margins,
            config=cfg.follow,
            reason=reason,
        )
        return answer or turn

    def _sees_little_ground(self, view: PolicyView, site_map: SiteMap) -> bool:
        cfg, pitch_rad = self.config, view.gimbal_pitch_rad
        if site_map.captured_s - site_map.ground_s > cfg.blind_s:
            return True
        height_m = view.height_above_ground_m
        shown = ground_share(site_map, view.camera, pitch_rad, height_m, cfg.pointing)
        if site_map.untracked_s < cfg.blind_s + cfg.back_s:
            shown = min(shown, float(np.mean(view.class_map.is_ground)))
        return shown < cfg.pointing.little


def _ground_rad(site_map: SiteMap, around_m: float) -> float | None:
    """Return the bearing of the mean of the ground around the drone; None if none was seen."""
    pose, reach = site_map.pose, math.ceil(around_m / site_map.cell_m)
    first = np.maximum(np.array(site_map.cell_of(pose.x_m, pose.y_m)) - reach, 0)
    window = site_map.ground[first[0] :, first[1] :][: 2 * reach + 1, : 2 * reach + 1]
    places_m = pose.points_to_body(site_map.middles_m(np.argwhere(window) + first))
    near_m = places_m[np.hypot(*places_m.T) <= around_m]
    if not len(near_m):
        near_m = pose.points_to_body(site_map.middles_m(np.argwhere(site_map.ground)))
    if not len(near_m):
        return None
    forward_m, right_m = near_m.mean(axis=0)
    return math.atan2(right_m, forward_m)
