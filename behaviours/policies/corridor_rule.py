"""The paper's second-level rule: advance up to one metre while the safety corridor is free.

    front clear beyond 2 m      advance up to 1 m
    something nearer            advance as far as is safe
    too near for a step         turn away from the side with the nearest obstacle
    ground ends                 turn to the half with more ground, as in the first level
    no depth                    turn on the spot and look again

A step is the least of four lengths: the free corridor (from the depth map), the ground ahead (from
the class map and the camera's geometry), the path clear of obstacles on the map (a forward-looking
camera does not see those beside the drone), and the longest step.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from behaviours.policies.view import nearest_ground_m
from uav_bt.answers import Advance, Blocked
from uav_bt.errors import ValueRangeError
from uav_bt.lab.classes import GROUND, OBSTACLE, OUTSIDE
from uav_bt.protocols import PolicyView
from uav_bt.types import MIN_VIEW_HEIGHT_M
from uav_bt.types.projection import project

_ACROSS: int = 9  # samples of the ground's width at each range
_RANGE_STEP_M = 0.05
_SHOWN_M = 1.0  # length of the nearest ground in view that must be ground
_FARTHEST_M = 20.0  # ground further away is not looked at; bounds the number of samples


@dataclass(frozen=True, kw_only=True)
class CorridorRuleConfig:
    """Lengths of steps, and the distances that they keep."""

    longest_step_m: float = 1.0  # the paper's
    shortest_step_m: float = 0.3  # the first level's step
    turn_rad: float = math.radians(30)  # one correction; a third of the view
    # Between the body's centre at the step's end and an obstacle ahead. The body reaches 0.12 m
    # ahead of its centre and 0.16 m to either side (`Airframe`), so 0.2 m at any heading. A step
    # of 1 m strays by 0.1 m, and the depth has an error of 0.1 m.
    front_margin_m: float = 0.6
    # Between the body's centre at the step's end and the end of the ground.
    edge_margin_m: float = 0.5
    ground_half_width_m: float = 0.4  # of the strip ahead that must be ground
    ground_share: float = 0.7  # of the strip's width, at every range
    ground_range_m: float = 4.0  # from the camera; further away one row spans several decimetres
    side_margin_m: float = 0.55  # from the body's centre to obstacles on the map beside the path
    # Reduction of every margin after each full turn without a free path. Obstacles on the map are
    # off by up to 0.2 m after half a minute of turning, and the body's half diagonal is 0.2 m.
    margin_relief_m: float = 0.04
    max_full_turns: int = 3  # full turns after which the margins shrink no further
    # A turn ends only with this much more free path than a step, which prevents dithering.
    hysteresis_m: float = 0.15
    # An obstacle of unknown range within this bearing from straight ahead forbids a step.
    unplaced_half_angle_rad: float = math.radians(45)
    unplaced_min: int = 2  # fewer are mask noise
    tie_ratio: float = 0.1  # halves closer than this are a tie, which the random sample decides

    def __post_init__(self) -> None:
        if not 0.0 < self.shortest_step_m <= self.longest_step_m:
            raise ValueRangeError(f"steps must be positive and in order, got {self}")
        if not 0.0 < self.turn_rad <= math.pi:
            raise ValueRangeError(f"a turn must lie within 0 and pi, got {self.turn_rad} rad")


def ground_reach(roles: NDArray[np.uint8], view: PolicyView, config: CorridorRuleConfig) -> float:
    """Return the length of the ground ahead of the camera, metres; inf when no end is in view.

    0 if no ground within 20 m is in view.

    Boxes and the mark stand on the ground, so they count as ground. The floor below the image's
    lower edge counts as ground if the lowest visible rows show ground.

    Args:
        roles: (H, W) uint8, role ids.
        view: the view of these roles.
        config: width, share and range.
    """
    height_m = max(view.height_above_ground_m, MIN_VIEW_HEIGHT_M)
    shown_m = min(nearest_ground_m(view) + _SHOWN_M, _FARTHEST_M)  # of a high or level camera
    ranges = np.arange(_RANGE_STEP_M, max(config.ground_range_m, shown_m), _RANGE_STEP_M)
    across = np.linspace(-config.ground_half_width_m, config.ground_half_width_m, _ACROSS)
    points = np.empty((ranges.size, across.size, 3))
    points[..., 0], points[..., 1], points[..., 2] = ranges[:, None], across, height_m
    pixels = project(points, view.camera, view.gimbal_pitch_rad)
    with np.errstate(invalid="ignore"):
        columns, rows = np.rint(pixels[..., 0]), np.rint(pixels[..., 1])
        inside = (columns >= 0) & (columns < roles.shape[1]) & (rows >= 0)
        inside &= rows < roles.shape[0]
    is_background = np.zeros(inside.shape, dtype=bool)
    seen = roles[rows[inside].astype(int), columns[inside].astype(int)]
    is_background[inside] = seen == OUTSIDE
    visible = inside.any(axis=1)
    if not visible.any():
        return 0.0
    allowed = (1.0 - config.ground_share) * np.maximum(inside.sum(axis=1), 1)
    ends = is_background.sum(axis=1) > allowed
    if not ends.any():
        return math.inf
    # The nearest visible row is background: the ground ends somewhere below the view.
    return 0.0 if ends[visible.argmax()] else float(ranges[ends.argmax()])


class CorridorRule:
    """The rule as a leaf policy."""

    def __init__(self, config: CorridorRuleConfig | None = None) -> None:
        self.config = config or CorridorRuleConfig()

    def decide(self, view: PolicyView) -> Advance | Blocked:
        """Return an advance or a turn. A turn keeps its direction until the path is free."""
        cfg = self.config
        relief_m = cfg.margin_relief_m * min(view.full_turns, cfg.max_full_turns)
        if view.corridor is None:
            return Blocked(
                yaw_rad=self._held(view, view.tie_break - 0.5), reason="no depth", free_m=0.0
            )
        roles = view.class_map.roles
        reach_m = ground_reach(roles, view, cfg) + view.camera.forward_offset_m
        by_ground_m = reach_m - cfg.edge_margin_m + relief_m
        by_corridor_m = view.corridor.free_distance_m - cfg.front_margin_m + relief_m
        min_step_m = cfg.shortest_step_m + (cfg.hysteresis_m if view.turning else 0.0)
        ground_ends = by_ground_m < min_step_m
        margin_m = cfg.side_margin_m - relief_m
        free_m = self._beside(view, max(0.0, min(cfg.longest_step_m, by_corridor_m)), margin_m)
        step_m = min(cfg.longest_step_m, by_ground_m, by_corridor_m)
        if step_m >= min_step_m:
            as_far = by_ground_m >= min(cfg.longest_step_m, by_corridor_m)
            step_m = free_m if as_far else self._beside(view, step_m, margin_m)
        if step_m >= cfg.shortest_step_m and not ground_ends and by_corridor_m >= min_step_m:
            return Advance(forward_m=step_m, reason="clear", free_m=free_m)
        if ground_ends:
            side = self._more(roles, view, GROUND)
            reason = "edge" if by_corridor_m >= min_step_m else "corner"
        else:
            side = self._away(roles, view)
            reason = "obstacle"
        return Blocked(
            yaw_rad=self._held(view, side), ground_ends=ground_ends, reason=reason, free_m=free_m
        )

    def _beside(self, view: PolicyView, step_m: float, margin_m: float) -> float:
        """Return the longest step up to `step_m` that obstacles on the map allow, or zero."""
        if view.site_map is None:
            return step_m
        cfg, near = self.config, view.site_map.near
        if near.unplaced_within(cfg.unplaced_half_angle_rad) >= cfg.unplaced_min:
            return 0.0
        assumed = view.full_turns == 0
        for length_m in (step_m, *np.arange(0.9, cfg.shortest_step_m - 0.01, -0.1)):
            if length_m <= step_m and near.allows(
                float(length_m), margin_m=margin_m, assumed=assumed
            ):
                return float(length_m)
        return 0.0

    def _held(self, view: PolicyView, side: float) -> float:
        """Return a turn to `side` (positive: clockwise), or on in the direction under way."""
        return math.copysign(self.config.turn_rad, view.turning or side)

    def _away(self, roles: NDArray[np.uint8], view: PolicyView) -> float:
        """Return the side to turn to: away from the intrusion, or to the emptier half."""
        nearest = view.corridor.nearest_side if view.corridor is not None else None
        if nearest in {"left", "right"}:
            return 1.0 if nearest == "left" else -1.0
        return -self._more(roles, view, OBSTACLE)

    def _more(self, roles: NDArray[np.uint8], view: PolicyView, role: int) -> float:
        """Return the side that shows more of a role; the random sample decides a tie."""
        middle = roles.shape[1] // 2
        left = int(np.count_nonzero(roles[:, :middle] == role))
        right = int(np.count_nonzero(roles[:, middle:] == role))
        if abs(left - right) <= self.config.tie_ratio * max(left, right):
            return view.tie_break - 0.5
        return 1.0 if right > left else -1.0
