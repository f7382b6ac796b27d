"""Limits and area of every movement, including the distance that a stop needs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

from uav_bt.errors import ValueRangeError
from uav_bt.settings import check_numbers
from uav_bt.types import Airframe, DroneState, Pose2D
from uav_bt.types.area import Area, Edge, margin_m, to_edge
from uav_bt.types.commands import MoveBy, Movement, Velocity
from uav_bt.types.pose import clamp, limit_length, rotate

_KEPT_M: Final = 0.1  # from the boundary at the end of a `MoveBy`; chosen, its overshoot
_STEP_M: Final = 0.05  # between the checked points of a `MoveBy`
_ON_IT_M: Final = 1e-6  # a place nearer to the boundary counts as outside; rounding
_INWARDS: Final = 0.5  # least cosine between a movement from outside and the way in; chosen


@dataclass(frozen=True, kw_only=True)
class Limits:
    """Limits of movements, and conditions that land the drone regardless of the leaves.

    The greatest ages of frames and telemetry are those of the board keys `frame` and `state`
    (`uav_bt.board.keys`).

    Attributes:
        speed_mps: horizontal speed, metres per second. Chosen: it crosses a lab of 5 m in 5 s.
        climb_mps: vertical speed, metres per second, both ways. Chosen: the indoor setting of an
            ANAFI.
        yaw_rate_radps: turning rate, radians per second, both ways. Chosen: a full turn in 4 s.
        ceiling_m: greatest height above the ground, metres. Chosen: below the ceiling of a room.
        floor_m: least height above the ground, metres; it does not bound a landing. Chosen: about
            one body width.
        step_m: greatest horizontal length of a `MoveBy`, metres. Chosen: twice the lab.
        critical_battery: charge, 0 to 1, below which the drone lands. Chosen: 2.5 of 25 minutes.
        blind_s: the mission ends with a landing after this time without a fresh frame, seconds.
            Chosen: a video that pauses for some seconds (`video-lost~3`) ends no mission.
        link_lost_s: the mission ends after this time without fresh telemetry, seconds. Chosen: as
            long as a connection may take (`OlympeConfig.connect_limit_s`).

    Raises:
        ValueRangeError: a number is out of its range, or the floor is not below the ceiling.
    """

    speed_mps: float = 1.0
    climb_mps: float = 0.6
    yaw_rate_radps: float = 1.6
    ceiling_m: float = 2.4
    floor_m: float = 0.3
    step_m: float = 10.0
    critical_battery: float = 0.1
    blind_s: float = 15.0
    link_lost_s: float = 10.0

    def __post_init__(self) -> None:
        check_numbers(self, {"floor_m": 0.0, "critical_battery": 0.0}, {"critical_battery": 1.0})
        if not self.floor_m < self.ceiling_m:
            raise ValueRangeError(
                f"floor_m must be below the ceiling of {self.ceiling_m:g} m, got {self.floor_m:g}"
            )


def limit_movement(
    movement: Movement,
    state: DroneState,
    limits: Limits,
    airframe: Airframe,
    *,
    state_age_s: float = 0.0,
    landing: bool = False,
) -> Movement:
    """Return a movement within the limits; a `landing` is limited in speed only."""
    height_m = state.height_above_ground_m
    up_m = max(0.0, limits.ceiling_m - height_m)
    down_m = max(0.0, height_m - limits.floor_m)
    if isinstance(movement, MoveBy):
        forward_m, right_m = limit_length(movement.forward_m, movement.right_m, limits.step_m)
        return replace(
            movement,
            forward_m=forward_m,
            right_m=right_m,
            down_m=min(max(movement.down_m, -up_m), down_m),
            yaw_rad=clamp(movement.yaw_rad, math.tau),
        )
    if not isinstance(movement, Velocity):
        return movement
    up_mps = down_mps = limits.climb_mps
    if not landing:
        braking_mps2 = airframe.climb_braking_mps2
        up_mps = min(up_mps, approach_speed_mps(up_m, braking_mps2, airframe, state_age_s))
        down_mps = min(down_mps, approach_speed_mps(down_m, braking_mps2, airframe, state_age_s))
    ahead_mps, right_mps = limit_length(movement.forward_mps, movement.right_mps, limits.speed_mps)
    return Velocity(
        forward_mps=ahead_mps,
        right_mps=right_mps,
        down_mps=min(max(movement.down_mps, -up_mps), down_mps),
        yaw_rate_radps=clamp(movement.yaw_rate_radps, limits.yaw_rate_radps),
    )


def approach_speed_mps(
    room_m: float, braking_mps2: float, airframe: Airframe, state_age_s: float
) -> float:
    """Return the greatest speed towards a bound that a drone stops at without crossing it.

    The drone gets a new velocity in every tick and follows it late. A loop x' = -k x with a dead
    time d and a lag T approaches zero without crossing it for k <= 1 / (e d) where T = 0 and for
    k <= 1 / (4 T) where d = 0; 1 / (e d + 4 T) lies below the bound of every mixture. The distance
    of braking, v^2 / (2 a), comes on top:

        room = (e d + 4 T) v + v^2 / (2 a)

    `room_m` is the distance to the bound, `state_age_s` the age of the value that it is from.
    """
    delay_s = airframe.command_delay_s + state_age_s
    late_s = math.e * delay_s + 4.0 * airframe.command_lag_s
    return braking_mps2 * (math.sqrt(late_s**2 + 2.0 * room_m / braking_mps2) - late_s)


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
        if not isinstance(movement, Velocity) or movement.forward_mps == movement.right_mps == 0.0:
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
    here_m = margin_m(edges, at.x_m, at.y_m)
    there_m = margin_m(edges, at.x_m + scale * vx, at.y_m + scale * vy)
    return there_m - here_m >= _INWARDS * _STEP_M
