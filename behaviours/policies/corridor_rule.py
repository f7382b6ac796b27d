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
from typing import Final

import numpy as np

from behaviours.policies.view import greater_side, is_unplaced_ahead, nearest_ground_m
from uav_bt.answers import Advance, Blocked
from uav_bt.lab.classes import GROUND, OBSTACLE, OUTSIDE
from uav_bt.protocols import PolicyView
from uav_bt.types import MIN_VIEW_HEIGHT_M
from uav_bt.types.arrays import Ids
from uav_bt.types.projection import project

_LONGEST_STEP_M: Final = 1.0  # the paper's
_SHORTEST_STEP_M: Final = 0.3  # the first level's step
TURN_RAD: Final = math.radians(30)  # one correction; a third of the view
# Between the body's centre at the step's end and an obstacle ahead. The body reaches 0.12 m ahead
# of its centre and 0.16 m to either side (`Airframe`), so 0.2 m at any heading. A step of 1 m
# strays by 0.1 m, and the depth has an error of 0.1 m.
_FRONT_MARGIN_M: Final = 0.6
GROUND_END_M: Final = 0.5  # between the body's centre at the step's end and the ground's end
_GROUND_HALF_WIDTH_M: Final = 0.4  # of the strip ahead that must be ground
_GROUND_SHARE: Final = 0.7  # of the strip's width, at every range
_GROUND_RANGE_M: Final = 4.0  # from the camera; further away one row spans several decimetres
_ACROSS: Final = 9  # samples of the ground's width at each range
_RANGE_STEP_M: Final = 0.05
_SHOWN_M: Final = 1.0  # length of the nearest ground in view that must be ground
_FARTHEST_M: Final = 20.0  # ground further away is not looked at; bounds the number of samples
_SIDE_MARGIN_M: Final = 0.55  # from the body's centre to obstacles on the map beside the path
# Reduction of every margin after each full turn without a free path: obstacles on the map are off
# by up to 0.2 m after half a minute of turning.
_MARGIN_RELIEF_M: Final = 0.04
_MAX_FULL_TURNS: Final = 3  # full turns after which the margins shrink no further
# A turn ends only with this much more free path than a step, which prevents dithering.
_HYSTERESIS_M: Final = 0.15


def ground_reach(roles: Ids, view: PolicyView) -> float:
    """Return the length of the ground ahead of the camera, metres; inf when no end is in view.

    0 if no ground within 20 m is in view. What stands on the ground counts as ground, and so does
    the floor below the image's lower edge if the lowest visible rows show ground.
    """
    height_m = max(view.height_above_ground_m, MIN_VIEW_HEIGHT_M)
    shown_m = min(nearest_ground_m(view) + _SHOWN_M, _FARTHEST_M)  # of a high or level camera
    ranges = np.arange(_RANGE_STEP_M, max(_GROUND_RANGE_M, shown_m), _RANGE_STEP_M)
    across = np.linspace(-_GROUND_HALF_WIDTH_M, _GROUND_HALF_WIDTH_M, _ACROSS)
    points = np.empty((ranges.size, across.size, 3))
    points[..., 0], points[..., 1], points[..., 2] = ranges[:, None], across, height_m
    pixels = project(points, view.camera, view.gimbal_pitch_rad)
    with np.errstate(invalid="ignore"):
        columns, rows = np.rint(pixels[..., 0]), np.rint(pixels[..., 1])
        inside = (columns >= 0) & (columns < roles.shape[1])
        inside &= (rows >= 0) & (rows < roles.shape[0])
    is_background = np.zeros(inside.shape, dtype=bool)
    seen = roles[rows[inside].astype(int), columns[inside].astype(int)]
    is_background[inside] = seen == OUTSIDE
    visible = inside.any(axis=1)
    if not visible.any():
        return 0.0
    allowed = (1.0 - _GROUND_SHARE) * np.maximum(inside.sum(axis=1), 1)
    ends = is_background.sum(axis=1) > allowed
    if not ends.any():
        return math.inf
    # The nearest visible row is background: the ground ends somewhere below the view.
    return 0.0 if ends[visible.argmax()] else float(ranges[ends.argmax()])


class CorridorRule:
    """The rule as a leaf policy."""

    def decide(self, view: PolicyView) -> Advance | Blocked:
        """Return an advance or a turn. A turn keeps its direction until the path is free."""
        corridor, roles = view.corridor, view.class_map.roles
        if corridor is None:
            return Blocked(yaw_rad=_held(view, view.tie_break - 0.5), reason="no depth", free_m=0.0)
        relief_m = _MARGIN_RELIEF_M * min(view.full_turns, _MAX_FULL_TURNS)
        reach_m = ground_reach(roles, view) + view.camera.forward_offset_m
        by_ground_m = reach_m - GROUND_END_M + relief_m
        by_corridor_m = corridor.free_distance_m - _FRONT_MARGIN_M + relief_m
        min_step_m = _SHORTEST_STEP_M + (_HYSTERESIS_M if view.turning else 0.0)
        ground_ends = by_ground_m < min_step_m
        margin_m = _SIDE_MARGIN_M - relief_m
        free_m = _beside(view, max(0.0, min(_LONGEST_STEP_M, by_corridor_m)), margin_m)
        step_m = min(_LONGEST_STEP_M, by_ground_m, by_corridor_m)
        if step_m >= min_step_m:
            as_far = by_ground_m >= min(_LONGEST_STEP_M, by_corridor_m)
            step_m = free_m if as_far else _beside(view, step_m, margin_m)
        if step_m >= _SHORTEST_STEP_M and not ground_ends and by_corridor_m >= min_step_m:
            return Advance(forward_m=step_m, reason="clear", free_m=free_m)
        if ground_ends:
            side = _more(view, GROUND)
            reason = "edge" if by_corridor_m >= min_step_m else "corner"
        else:  # away from the intrusion, or to the emptier half
            beside = {"left": 1.0, "right": -1.0}.get(corridor.nearest_side or "")
            side = -_more(view, OBSTACLE) if beside is None else beside
            reason = "obstacle"
        yaw_rad = _held(view, side)
        return Blocked(yaw_rad=yaw_rad, ground_ends=ground_ends, reason=reason, free_m=free_m)


def _beside(view: PolicyView, step_m: float, margin_m: float) -> float:
    """Return the longest step up to `step_m` that obstacles on the map allow, or zero."""
    if view.site_map is None:
        return step_m
    near, assumed = view.site_map.near, view.full_turns == 0
    if is_unplaced_ahead(view):
        return 0.0
    for length_m in (step_m, *np.arange(0.9, _SHORTEST_STEP_M - 0.01, -0.1).tolist()):
        if length_m <= step_m and near.allows(length_m, margin_m=margin_m, assumed=assumed):
            return float(length_m)
    return 0.0


def _held(view: PolicyView, side: float) -> float:
    """Return a turn to `side` (positive: clockwise), or on in the direction under way."""
    return math.copysign(TURN_RAD, view.turning or side)


def _more(view: PolicyView, role: int) -> float:
    """Return the side that shows more of a role; the random sample decides a tie."""
    shown = view.class_map.roles == role
    middle = shown.shape[1] // 2
    left, right = np.count_nonzero(shown[:, :middle]), np.count_nonzero(shown[:, middle:])
    return greater_side(view, int(left), int(right))
