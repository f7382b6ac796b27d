"""Coverage in steps and turns: what the site map says of the movements of who sees pixels only.

    the map leaves room ahead       advance so far, up to 1 m
    it leaves less than a step      turn to the side that `coverage` would fly to

It teaches the control student. Where coverage would fly to is hardly told from a view, but that the
way ahead is free is, and the map knows it better than a rule that judges the same view: it holds
what stands beside the drone, and what has left the view.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from behaviours.path.following import around
from behaviours.path.room import Flags, Floats, Margins, Room
from behaviours.policies.coverage import Coverage
from uav_bt.errors import MissionError
from uav_bt.protocols import Decision, PolicyView
from uav_bt.types.site_map import SiteMap

_SAMPLE_M = 0.05  # on the way ahead


@dataclass(frozen=True, kw_only=True)
class CoverageStepsConfig:
    """How far steps go and what they keep clear of. Distances are from the body's centre."""

    # Wider than the planner's: who judges single views errs more than who keeps a map.
    margins: Margins = field(default_factory=lambda: Margins(touch_m=0.45, edge_m=0.45))
    longest_step_m: float = 1.0
    shortest_step_m: float = 0.3
    hysteresis_m: float = 0.15  # leaving a turn takes so much more room than a step
    turn_rad: float = math.radians(30)  # one correction
    # Less room after each full turn without a free way.
    relief_m: float = 0.04
    max_full_turns: int = 3  # of relief


class CoverageSteps:
    """The teacher as a leaf policy.

    Args:
        config: how far steps go.
    """

    def __init__(self, config: CoverageStepsConfig | None = None) -> None:
        self.config = config or CoverageStepsConfig()
        self._coverage = Coverage()

    def decide(self, view: PolicyView) -> Decision:
        """Return an advance or a turn. A turn under way keeps its direction until it worked.

        Raises:
            MissionError: no leaf keeps a map for it.
        """
        cfg, site_map = self.config, view.site_map
        if site_map is None:
            raise MissionError(
                "policy 'coverage_steps' judges the way by the map of the place, and none is on "
                "the board: put <Segment/> and <RememberObstacles/> ahead of the leaves that fly"
            )
        relief_m = cfg.relief_m * min(view.full_turns, cfg.max_full_turns)
        margins = replace(
            cfg.margins,
            touch_m=cfg.margins.touch_m - relief_m,
            edge_m=cfg.margins.edge_m - relief_m,
        )
        room = Room(site_map, around(view.obstacles, site_map), margins)
        ways_m = _ahead(site_map, cfg.longest_step_m)
        step_m = _free_m(room.open, site_map, ways_m)
        free_m = _free_m(room.obstacle_m >= room.margins.touch_m, site_map, ways_m)
        least_m = cfg.shortest_step_m + (cfg.hysteresis_m if view.turning else 0.0)
        if step_m >= least_m:
            return Decision(forward_m=step_m, reason="clear", free_m=max(free_m, step_m))
        ends = step_m < cfg.shortest_step_m <= free_m
        wanted = self._coverage.decide(view)
        return Decision(
            yaw_rad=math.copysign(cfg.turn_rad, view.turning or wanted.yaw_rad),
            carpet_ends=ends,
            reason="edge" if ends else "obstacle",
            free_m=free_m,
        )


def _ahead(site_map: SiteMap, longest_m: float) -> Floats:
    """Return the places ahead of the drone, (N, 2) in the map's frame, the nearest first."""
    reach_m = np.arange(_SAMPLE_M, longest_m + _SAMPLE_M / 2, _SAMPLE_M)
    pose = site_map.pose
    return np.array((pose.x_m, pose.y_m)) + reach_m[:, None] * (
        math.cos(pose.yaw_rad),
        math.sin(pose.yaw_rad),
    )


def _free_m(free: Flags, site_map: SiteMap, places_m: Floats) -> float:
    """Return how far the way ahead lies on free cells."""
    blocked = ~site_map.lies_on(free, places_m)
    return _SAMPLE_M * (int(blocked.argmax()) if blocked.any() else len(places_m))
