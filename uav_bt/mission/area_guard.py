"""Keeps movements within the area of a mission, including the distance that a stop needs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from uav_bt.mission.limits import approach_speed_mps
from uav_bt.types import Airframe, MoveBy, Movement, Pose2D, Velocity, rotate
from uav_bt.types.area import Area, Edge, margin_m, to_edge

_KEPT_M: Final = 0.1  # from the boundary at the end of a `MoveBy`; chosen, its overshoot
_STEP_M: Final = 0.05  # between the checked points of a `MoveBy`
_ON_IT_M: Final = 1e-6  # a place nearer to the boundary counts as outside; rounding
_INWARDS: Final = 0.5  # least cosine between a movement from outside and the way in; chosen


class AreaGuard:
    """Cuts movements that would leave an area.

    The direction of a movement is kept: a deflected movement could end in an obstacle. A velocity
    is reduced to the speed from which the drone stops at the boundary, a `MoveBy` is shortened. A
    drone outside may only move back in. While its place is unknown it may not move horizontally.
    Climbs, descents and turns pass.
    """

    def __init__(self, area: Area, airframe: Airframe | None = None) -> None:
        self._area = area
        self._airframe = airframe or Airframe()
        self._cut: tuple[MoveBy, MoveBy] | None = None  # the last `MoveBy`: given, and shortened

    def limited(self, movement: Movement, at: Pose2D | None, *, age_s: float = 0.0) -> Movement:
        """Return a movement that stays in the area, from a pose relative to the take-off pose."""
        if isinstance(movement, MoveBy):
            return self._shortened(movement, at)
        if not isinstance(movement, Velocity):
            return movement
        if movement.forward_mps == 0.0 and movement.right_mps == 0.0:
            return movement
        share = 0.0 if at is None else self._share(movement, at, age_s)
        return replace(
            movement,
            forward_mps=share * movement.forward_mps,
            right_mps=share * movement.right_mps,
        )

    def _share(self, movement: Velocity, at: Pose2D, age_s: float) -> float:
        """Return the share of a velocity that may be flown, 0 to 1."""
        vx, vy = rotate(movement.forward_mps, movement.right_mps, at.yaw_rad)
        share = 1.0
        for edges in self._area.edges:
            if margin_m(edges, at.x_m, at.y_m) < _ON_IT_M:
                if not _leads_in(edges, at, vx, vy):
                    return 0.0
                continue
            for edge in edges:
                dx, dy = to_edge(edge, at.x_m, at.y_m)
                room_m = math.hypot(dx, dy)
                nearing_mps = (vx * dx + vy * dy) / room_m
                frame = self._airframe
                most_mps = approach_speed_mps(room_m, frame.braking_mps2, frame, age_s)
                if nearing_mps > most_mps:
                    share = min(share, most_mps / nearing_mps)
        return share

    def _shortened(self, move: MoveBy, at: Pose2D | None) -> MoveBy:
        """Return a `MoveBy` that ends in the area; the drone flies one of a number once."""
        if self._cut is not None and self._cut[0] == move:
            return self._cut[1]
        length_m = math.hypot(move.forward_m, move.right_m)
        share = 0.0 if length_m == 0.0 or at is None else self._reach_m(move, at) / length_m
        cut = replace(move, forward_m=share * move.forward_m, right_m=share * move.right_m)
        if length_m == 0.0 or share == 1.0:
            cut = move
        self._cut = move, cut
        return cut

    def _reach_m(self, move: MoveBy, at: Pose2D) -> float:
        """Return the length of a movement's part that keeps its distance from the boundary."""
        dx, dy = rotate(move.forward_m, move.right_m, at.yaw_rad)
        length_m = math.hypot(dx, dy)
        steps = math.ceil(length_m / _STEP_M)
        reach_m, here_m = 0.0, self._area.margin_m(at.x_m, at.y_m)
        for step in range(1, steps + 1):
            share = step / steps
            next_m = self._area.margin_m(at.x_m + share * dx, at.y_m + share * dy)
            gain_m = _INWARDS * length_m / steps if here_m < 0.0 else -_ON_IT_M
            if next_m < min(_KEPT_M, here_m + gain_m):
                break
            reach_m, here_m = share * length_m, next_m
        return reach_m


def _leads_in(edges: Sequence[Edge], at: Pose2D, vx: float, vy: float) -> bool:
    """Return whether a velocity leads from the boundary, or from outside, into a polygon."""
    scale = _STEP_M / math.hypot(vx, vy)
    gain_m = margin_m(edges, at.x_m + scale * vx, at.y_m + scale * vy) - margin_m(
        edges, at.x_m, at.y_m
    )
    return gain_m >= _INWARDS * _STEP_M
