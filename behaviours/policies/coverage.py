"""Cover the place: fly to where the most new ground lies for the least time, over the site map."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from behaviours.path.survey import Leg, Room, SurveyConfig, best_leg, new_ground_per_second
from uav_bt.protocols import Decision, PolicyView
from uav_bt.types.site_map import SiteMap

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class CoverageConfig:
    """How legs are flown."""

    survey: SurveyConfig = field(default_factory=SurveyConfig)
    # When legs with all that room bring less new ground than this, narrower ones are tried.
    little_m2ps: float = 0.03
    tight_m: float = 0.38  # from obstacles
    turn_rad: float = math.radians(30)  # when no way is known: look further round
    facing_rad: float = math.radians(35)  # the drone flies on below this error of its heading
    # The corridor is wider than the way past a box whose place the map knows: what it shows ahead
    # slows the drone down, and stops it only so near.
    stop_m: float = 0.45
    creep_mps: float = 0.2
    near_m: float = 0.35
    reaction_s: float = 0.45  # from a frame to its effect
    brake_mps2: float = 0.8


class Coverage:
    """The planner as a leaf policy.

    Args:
        config: how legs are flown.
        value: of a leg: of the new ground that it passes, m2, for its time, s.
    """

    def __init__(
        self,
        config: CoverageConfig | None = None,
        value: Callable[[float, float], float] = new_ground_per_second,
    ) -> None:
        self.config = config or CoverageConfig()
        self._value = value

    def decide(self, view: PolicyView) -> Decision:
        """Return a heading and a speed; a turn when no way is known; done when all is covered."""
        cfg, site_map = self.config, view.site_map
        turn = Decision(
            yaw_rad=math.copysign(cfg.turn_rad, view.turning or 1.0), reason="no way", free_m=0.0
        )
        if site_map is None:
            return turn
        room = Room(site_map, *_around(view, site_map), config=cfg.survey)
        leg = best_leg(room, self._value)
        if leg is None or leg.new_m2 < cfg.little_m2ps * leg.time_s:
            narrow = replace(cfg.survey, touch_m=cfg.tight_m)
            room = Room(site_map, *_around(view, site_map), config=narrow)
            leg = best_leg(room, self._value) or leg
        if leg is None:
            covered = view.full_turns > 0 and not room.shut_in
            return Decision(done=True, reason="covered") if covered else turn
        bearing_rad, speed_mps = self._course(leg, site_map)
        facing = abs(bearing_rad) < cfg.facing_rad
        if facing:
            speed_mps = min(speed_mps * math.cos(bearing_rad), self._by_corridor(view))
            if speed_mps == 0.0:
                return turn
        return Decision(
            forward_m=float(np.hypot(*(leg.path_m[-1] - leg.path_m[0]))) or site_map.cell_m,
            yaw_rad=bearing_rad,
            speed_mps=speed_mps if facing else 0.0,
            reason=f"{leg.new_m2:.1f} m2 in {leg.time_s:.0f} s",
        )

    def _course(self, leg: Leg, site_map: SiteMap) -> tuple[float, float]:
        """Return bearing and speed to the furthest place of the path that is reached straight."""
        survey, pose = self.config.survey, site_map.pose
        apart = np.hypot(*(leg.path_m - leg.path_m[0]).T)
        ahead = int(np.argmax(apart >= survey.ahead_m)) or len(leg.path_m) - 1
        x_m, y_m = leg.path_m[ahead]
        forward_m, right_m = pose.to_body(float(x_m), float(y_m))
        speed = float(survey.speed_mps(leg.clear_m[: ahead + 1]).min())
        left_m = float(apart.max())
        braking = math.sqrt(2.0 * self.config.brake_mps2 * max(left_m - 0.05, 0.0)) + 0.1
        return math.atan2(right_m, forward_m), min(speed, braking)

    def _by_corridor(self, view: PolicyView) -> float:
        """Return the speed from which the drone stops before what the corridor shows."""
        cfg = self.config
        if view.corridor is None:
            return math.inf
        free_m = view.corridor.free_distance_m
        if free_m < cfg.near_m:
            return 0.0
        lag = cfg.brake_mps2 * cfg.reaction_s
        room_m = max(free_m - cfg.stop_m, 0.0)
        return max(cfg.creep_mps, math.sqrt(lag**2 + 2.0 * cfg.brake_mps2 * room_m) - lag)


def _around(view: PolicyView, site_map: SiteMap) -> tuple[Floats, Floats]:
    """Return where obstacles were seen lately, and are assumed, around the drone, on the map.

    Where the map is off by some centimetres, what was seen lately is right about the drone.
    """
    if view.obstacles is None:
        return np.empty((0, 2)), np.empty((0, 2))
    return (
        site_map.pose.points_to_world(view.obstacles.points_m),
        site_map.pose.points_to_world(view.obstacles.assumed_m),
    )
