"""The paper's first-level rule: two rectangles of the class map, one high, one low.

    low full,  high empty   advance 30 cm
    low full,  high filled  turn to the half with fewer obstacle pixels
    low short, high empty   turn to the half with more ground
    low short, high filled  turn round

The paper gives thresholds (1600 and 900 pixels of a 224x112 map) but not the rectangles. Here they
follow from the camera's geometry, so that each asks a question in metres. Pitch and height change
the number of pixels that show the same ground, and the thresholds with them. A higher drone sees no
ground as near; both ranges then count from the nearest ground in view.

- The *high* rectangle asks whether a box stands in the way. Its upper edge is the row that sees the
  ground `OBSTACLE_RANGE_M` ahead: a box whose base is further away does not reach into it. Its
  lower edge is the image's. A nearer box at the flight altitude fills it from top to bottom.
- The *low* rectangle asks whether the ground goes on. It spans the ground from the nearest place
  that the view of the thresholds shows to `GROUND_RANGE_M`. What stands on it counts as ground.

Both are as wide as the image of the swept path with its margins at that distance. A third test uses
the map: a step must keep a margin from every recently seen obstacle, because a forward-looking
camera does not see the obstacles beside the drone.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from behaviours.policies.view import greater_side, is_unplaced_ahead, nearest_ground_m
from uav_bt.answers import Advance, Blocked
from uav_bt.lab.classes import GROUND, OBSTACLE, OUTSIDE
from uav_bt.protocols import PolicyView
from uav_bt.types import MIN_VIEW_HEIGHT_M
from uav_bt.types.arrays import Flags
from uav_bt.types.projection import ground_range_to_row

ADVANCE_M: Final = 0.3  # the paper's advance
TURN_RAD: Final = math.radians(30)  # one correction; a third of the view
_REFERENCE_PIXELS: Final = 224 * 112  # the map size that the paper's pixel counts refer to
_OBSTACLE_PX: Final = 900.0  # threshold of the high rectangle, as in the paper
_GROUND_PX: Final = 1600.0  # threshold of the low rectangle, as in the paper
# The view in which the thresholds hold. Chosen: the flight height and pitch of the missions.
THRESHOLD_PITCH_RAD: Final = math.radians(-30)
THRESHOLD_HEIGHT_M: Final = 1.5
OBSTACLE_RANGE_M: Final = 1.6  # from the camera: boxes based beyond this are not in the way
# From the image's centre. The side of a box 0.4 m beside the path and 1.2 m ahead is seen at 14
# degrees. The other 8 degrees are the 26 columns that it needs to reach the threshold.
OBSTACLE_HALF_ANGLE_RAD: Final = math.radians(22)
GROUND_RANGE_M: Final = 1.75  # from the camera: required length of the ground ahead
GROUND_HALF_ANGLE_RAD: Final = math.radians(18)
# A turn ends at this share of the obstacle threshold, which prevents dithering at it.
_HYSTERESIS: Final = 0.75
# After each full turn without a free path the obstacle threshold grows and the ground threshold
# falls by these shares.
_OBSTACLE_RELIEF: Final = 0.35
_GROUND_RELIEF: Final = 0.2
_MAX_FULL_TURNS: Final = 3  # full turns after which the thresholds change no further
# From the body's centre to an obstacle's base on the map: 0.2 m is half the body's diagonal, the
# rest allows for drift and mask errors. From a nearer obstacle the drone may only leave.
_MARGIN_M: Final = 0.55
_MARGIN_RELIEF_M: Final = 0.06  # reduction of it after each full turn without a free path


class Rectangle(NamedTuple):
    """A region of a class map: rows [top, bottom), columns [left, right)."""

    top: int
    bottom: int
    left: int
    right: int

    def count(self, wanted: Flags) -> int:
        """Return the number of wanted pixels within the region."""
        return int(np.count_nonzero(wanted[self.top : self.bottom, self.left : self.right]))

    @property
    def size_px(self) -> int:
        """Number of its pixels."""
        return (self.bottom - self.top) * (self.right - self.left)


class SegmentationRule:
    """The rule as a leaf policy."""

    def rectangles(self, view: PolicyView) -> tuple[Rectangle, Rectangle]:
        """Return the high and the low rectangle for a view's camera, pitch and height."""
        high, low = _patches(view)
        return high._replace(bottom=view.camera.height_px), low

    def decide(self, view: PolicyView) -> Advance | Blocked:
        """Return an advance or a turn. A turn keeps its direction until the path is free."""
        roles = view.class_map.roles
        high, low = self.rectangles(view)
        # The thresholds hold for the sizes that the rectangles have in their view.
        sizes = zip(_patches(_of_thresholds(view)), _patches(view), strict=True)
        high_ratio, low_ratio = (usual.size_px / shown.size_px for usual, shown in sizes)
        per_px = _REFERENCE_PIXELS / roles.size
        obstacles = high.count(roles == OBSTACLE) * per_px * high_ratio
        ground = low.count(roles != OUTSIDE) * per_px * low_ratio
        relief = min(view.full_turns, _MAX_FULL_TURNS)
        obstacle_limit = _OBSTACLE_PX * (1.0 + _OBSTACLE_RELIEF * relief)
        if view.turning:
            obstacle_limit *= _HYSTERESIS
        way_is_free = obstacles <= obstacle_limit and _keeps_margin(view, relief)
        ground_goes_on = ground >= _GROUND_PX * (1.0 - _GROUND_RELIEF * relief)
        if way_is_free and ground_goes_on:
            return Advance(forward_m=ADVANCE_M, reason="clear")

        reason = "obstacle" if ground_goes_on else ("edge" if way_is_free else "corner")
        if view.turning:
            yaw_rad = math.copysign(TURN_RAD, view.turning)
        elif reason == "corner":
            yaw_rad = math.copysign(math.pi, view.tie_break - 0.5)
        else:  # away from obstacles, or to more ground; clockwise, to the right, is positive
            wanted = roles == (OBSTACLE if ground_goes_on else GROUND)
            middle = (high.left + high.right) // 2
            sides = (
                high._replace(right=middle).count(wanted),
                high._replace(left=middle).count(wanted),
            )
            left, right = reversed(sides) if ground_goes_on else sides
            yaw_rad = math.copysign(TURN_RAD, greater_side(view, left, right))
        return Blocked(yaw_rad=yaw_rad, ground_ends=not ground_goes_on, reason=reason)


def _keeps_margin(view: PolicyView, relief: int) -> bool:
    if view.site_map is None or is_unplaced_ahead(view):
        return view.site_map is None
    margin_m = _MARGIN_M - _MARGIN_RELIEF_M * relief
    # Assumed obstacles may block every path; after a full turn only seen ones count.
    return view.site_map.near.allows(ADVANCE_M, margin_m=margin_m, assumed=relief == 0)


def _patches(view: PolicyView) -> tuple[Rectangle, Rectangle]:
    """Return the parts of both rectangles that show the ground up to their ranges."""
    high = _rectangle(view, OBSTACLE_RANGE_M, OBSTACLE_HALF_ANGLE_RAD)
    return high, _rectangle(view, GROUND_RANGE_M, GROUND_HALF_ANGLE_RAD)


def _of_thresholds(view: PolicyView) -> PolicyView:
    pitch_rad, height_m = THRESHOLD_PITCH_RAD, THRESHOLD_HEIGHT_M
    return replace(view, gimbal_pitch_rad=pitch_rad, height_above_ground_m=height_m)


def _rectangle(view: PolicyView, range_m: float, half_angle_rad: float) -> Rectangle:
    """Return the rectangle from the nearest ground to a range, ahead of the camera."""
    camera, pitch_rad = view.camera, view.gimbal_pitch_rad
    height_m = max(view.height_above_ground_m, MIN_VIEW_HEIGHT_M)
    from_m = nearest_ground_m(_of_thresholds(view))
    nearest_m = max(from_m, nearest_ground_m(view))
    top = ground_range_to_row(range_m + nearest_m - from_m, camera, pitch_rad, height_m)
    bottom = ground_range_to_row(nearest_m, camera, pitch_rad, height_m)
    reach = camera.fx_px * math.tan(half_angle_rad)
    first = int(np.clip(round(top), 0, camera.height_px - 1))
    return Rectangle(
        top=first,
        bottom=int(np.clip(round(bottom) + 1, first + 1, camera.height_px)),
        left=int(np.clip(round(camera.cx_px - reach), 0, camera.width_px - 2)),
        right=int(np.clip(round(camera.cx_px + reach) + 1, 2, camera.width_px)),
    )
