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
  ground `obstacle_range_m` ahead: a box whose base is further away does not reach into it. Its
  lower edge is the image's. A nearer box that reaches the flight altitude fills it from top to
  bottom at any distance.
- The *low* rectangle asks whether the ground goes on. It spans the ground from the nearest place
  that the view of the thresholds shows to `ground_range_m`. Boxes and the mark stand on the ground,
  so they count as ground.

Both rectangles are as wide as the image of the swept path with its margins at the distance in
question.

A third test uses the map instead of the view: a step must keep `margin_m` from every recently seen
obstacle, because a forward-looking camera does not see the obstacles beside the drone.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from behaviours.policies.view import nearest_ground_m
from uav_bt.answers import Advance, Blocked
from uav_bt.errors import ValueRangeError
from uav_bt.lab.classes import GROUND, OBSTACLE, OUTSIDE
from uav_bt.protocols import PolicyView
from uav_bt.types import MIN_VIEW_HEIGHT_M, CameraModel
from uav_bt.types.projection import ground_range_to_row

_REFERENCE_PIXELS = 224 * 112  # the map size that the paper's pixel counts refer to


@dataclass(frozen=True)
class Rectangle:
    """A region of a class map: rows [top, bottom), columns [left, right)."""

    top: int
    bottom: int
    left: int
    right: int

    def of(self, image: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Return the region's pixels (a view)."""
        return image[self.top : self.bottom, self.left : self.right]

    def halves(self, image: NDArray[np.uint8]) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
        """Return the left and the right half of the region."""
        middle = (self.left + self.right) // 2
        rows = slice(self.top, self.bottom)
        return image[rows, self.left : middle], image[rows, middle : self.right]

    @property
    def size_px(self) -> int:
        """Number of its pixels."""
        return (self.bottom - self.top) * (self.right - self.left)


@dataclass(frozen=True, kw_only=True)
class SegmentationRuleConfig:
    """Positions, widths and thresholds of the rectangles, steps and margins."""

    step_m: float = 0.3  # the paper's advance
    turn_rad: float = math.radians(30)  # one correction; a third of the view
    obstacle_threshold_px: float = 900.0  # of a 224x112 map, as in the paper
    ground_threshold_px: float = 1600.0  # of a 224x112 map, as in the paper
    # The view in which the thresholds hold. Chosen: the flight height and pitch of the missions.
    threshold_pitch_rad: float = math.radians(-30)
    threshold_height_m: float = 1.5
    obstacle_range_m: float = 1.6  # from the camera: boxes based beyond this are not in the way
    # From the image's centre. The side of a box 0.4 m beside the path and 1.2 m ahead is seen at 14
    # degrees. The other 8 degrees are the 26 columns that it needs to reach the threshold.
    obstacle_half_angle_rad: float = math.radians(22)
    ground_range_m: float = 1.75  # from the camera: required length of the ground ahead
    ground_half_angle_rad: float = math.radians(18)
    # A turn ends at this share of the obstacle threshold, which prevents dithering at it.
    hysteresis: float = 0.75
    # After each full turn without a free path the obstacle threshold grows and the ground
    # threshold falls by these shares.
    obstacle_relief: float = 0.35
    ground_relief: float = 0.2
    max_full_turns: int = 3  # full turns after which the thresholds change no further
    # From the body's centre to an obstacle's base on the map: 0.2 m is half the body's diagonal,
    # the rest allows for drift and mask errors. From a nearer obstacle the drone may only leave.
    margin_m: float = 0.55
    margin_relief_m: float = 0.06  # reduction of margin_m after each full turn without a free path
    # An obstacle of unknown range within this bearing from straight ahead forbids a step. Outside
    # it the path passes the obstacle at 0.7 of its range or more.
    unplaced_half_angle_rad: float = math.radians(45)
    unplaced_min: int = 2  # fewer are mask noise
    tie_ratio: float = 0.1  # halves closer than this are a tie, which the random sample decides

    def __post_init__(self) -> None:
        if self.step_m <= 0.0 or not 0.0 < self.turn_rad <= math.pi:
            raise ValueRangeError(f"step and turn must be positive, got {self}")


def _count(region: NDArray[np.uint8], role: int) -> int:
    return int(np.count_nonzero(region == role))


class SegmentationRule:
    """The rule as a leaf policy."""

    def __init__(self, config: SegmentationRuleConfig | None = None) -> None:
        self.config = config or SegmentationRuleConfig()

    def rectangles(self, view: PolicyView) -> tuple[Rectangle, Rectangle]:
        """Return the high and the low rectangle for a view's camera, pitch and height."""
        high, low = self._patches(view)
        return replace(high, bottom=view.camera.height_px), low

    def decide(self, view: PolicyView) -> Advance | Blocked:
        """Return an advance or a turn. A turn keeps its direction until the path is free."""
        cfg = self.config
        roles = view.class_map.roles
        high, low = self.rectangles(view)
        # The thresholds hold for the sizes that the rectangles have in their view.
        sizes = zip(self._patches(self._of_thresholds(view)), self._patches(view), strict=True)
        high_ratio, low_ratio = (usual.size_px / shown.size_px for usual, shown in sizes)
        per_px = _REFERENCE_PIXELS / roles.size
        obstacles = _count(high.of(roles), OBSTACLE) * per_px * high_ratio
        ground = np.count_nonzero(low.of(roles) != OUTSIDE) * per_px * low_ratio

        relief = min(view.full_turns, cfg.max_full_turns)
        obstacle_limit = cfg.obstacle_threshold_px * (1.0 + cfg.obstacle_relief * relief)
        if view.turning:
            obstacle_limit *= cfg.hysteresis
        way_is_free = obstacles <= obstacle_limit and self._keeps_margin(view, relief)
        ground_goes_on = ground >= cfg.ground_threshold_px * (1.0 - cfg.ground_relief * relief)
        if way_is_free and ground_goes_on:
            return Advance(forward_m=cfg.step_m, reason="clear")

        reason = "obstacle" if ground_goes_on else ("edge" if way_is_free else "corner")
        yaw_rad = math.copysign(math.pi, view.tie_break - 0.5)
        if view.turning:
            yaw_rad = math.copysign(cfg.turn_rad, view.turning)
        elif ground_goes_on:
            left, right = (_count(half, OBSTACLE) for half in high.halves(roles))
            yaw_rad = self._turn(right, left, view.tie_break)
        elif way_is_free:
            left, right = (_count(half, GROUND) for half in high.halves(roles))
            yaw_rad = self._turn(left, right, view.tie_break)
        return Blocked(yaw_rad=yaw_rad, ground_ends=not ground_goes_on, reason=reason)

    def _keeps_margin(self, view: PolicyView, relief: int) -> bool:
        if view.site_map is None:
            return True
        cfg, near = self.config, view.site_map.near
        if near.unplaced_within(cfg.unplaced_half_angle_rad) >= cfg.unplaced_min:
            return False
        margin_m = cfg.margin_m - cfg.margin_relief_m * relief
        # Assumed obstacles may block every path; after a full turn only seen ones count.
        return near.allows(cfg.step_m, margin_m=margin_m, assumed=relief == 0)

    def _turn(self, for_left: int, for_right: int, tie_break: float) -> float:
        """Return a turn to the side with more votes; clockwise, to the right, is positive."""
        if abs(for_left - for_right) <= self.config.tie_ratio * max(for_left, for_right):
            return math.copysign(self.config.turn_rad, tie_break - 0.5)
        return self.config.turn_rad if for_right > for_left else -self.config.turn_rad

    def _patches(self, view: PolicyView) -> tuple[Rectangle, Rectangle]:
        """Return the parts of both rectangles that show the ground up to their ranges."""
        cfg = self.config
        high = self._rectangle(view, cfg.obstacle_range_m, cfg.obstacle_half_angle_rad)
        return high, self._rectangle(view, cfg.ground_range_m, cfg.ground_half_angle_rad)

    def _of_thresholds(self, view: PolicyView) -> PolicyView:
        cfg = self.config
        return replace(
            view,
            gimbal_pitch_rad=cfg.threshold_pitch_rad,
            height_above_ground_m=cfg.threshold_height_m,
        )

    def _rectangle(self, view: PolicyView, range_m: float, half_angle_rad: float) -> Rectangle:
        """Return the rectangle from the nearest ground to a range, ahead of the camera."""
        camera: CameraModel = view.camera
        height_m = max(view.height_above_ground_m, MIN_VIEW_HEIGHT_M)
        from_m = nearest_ground_m(self._of_thresholds(view))
        nearest_m = max(from_m, nearest_ground_m(view))
        top, bottom = (
            ground_range_to_row(each_m, camera, view.gimbal_pitch_rad, height_m)
            for each_m in (range_m + nearest_m - from_m, nearest_m)
        )
        reach = camera.fx_px * math.tan(half_angle_rad)
        first = int(np.clip(round(top), 0, camera.height_px - 1))
        return Rectangle(
            top=first,
            bottom=int(np.clip(round(bottom) + 1, first + 1, camera.height_px)),
            left=int(np.clip(round(camera.cx_px - reach), 0, camera.width_px - 2)),
            right=int(np.clip(round(camera.cx_px + reach) + 1, 2, camera.width_px)),
        )
