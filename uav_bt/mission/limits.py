"""Limits of every movement, including the distance that a stop needs."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from uav_bt.errors import ValueRangeError
from uav_bt.settings import check_numbers
from uav_bt.types import Airframe, DroneState, MoveBy, Movement, Velocity, clamp, limit_length


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
