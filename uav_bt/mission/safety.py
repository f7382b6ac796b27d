"""The arbiter: one command per tick, by the safety rules first, then by what the leaves propose.

The strongest rule that holds decides the tick; the leaves are asked only when none does. What lasts
too long becomes an abort, which is a landing. A test walks the table, rule by rule.

After all this the drone has rules of its own: an ANAFI that hears nothing from a program centres
its sticks and hovers at once, and lands or returns as its settings say when the link stays lost or
its battery is empty. No process that dies can take that away.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

from uav_bt.board.context import Proposals
from uav_bt.errors import ValueRangeError
from uav_bt.types import (
    Command,
    CutMotors,
    DroneState,
    FlyingState,
    Hover,
    Land,
    MoveBy,
    Movement,
    Release,
    Velocity,
)

AIRBORNE: Final = frozenset({FlyingState.HOVERING, FlyingState.FLYING})


class Override(enum.Enum):
    """Why the leaves were not asked, strongest first."""

    CUT = "motors cut"
    MANUAL = "manual take-over"
    ABORT = "abort"
    BATTERY = "critical battery"
    LINK = "link lost"
    STALE_FRAME = "stale frame"


@dataclass(frozen=True, kw_only=True)
class Limits:
    """What no leaf may exceed, and when the drone is stopped or landed whatever leaves want.

    Attributes:
        speed_mps: horizontal speed; a lab is 5 m long.
        climb_mps: vertical speed.
        yaw_rate_radps: turning rate.
        ceiling_m: height above the carpet.
        floor_m: height above the carpet below which no step leads; a landing is no step.
        step_m: horizontal length of a step.
        critical_battery: charge, 0 to 1, below which the drone lands.
        stale_frame_s: the drone hovers while its newest frame is older; leaves do not see it then
            either (`uav_bt.board.keys`).
        stale_state_s: the drone hovers while its newest telemetry is older; it comes at 5 Hz.
        blind_s: the drone lands after so long without a fresh frame.
        link_lost_s: the mission ends after so long without telemetry.

    Raises:
        ValueRangeError: a limit of a movement is not positive.
    """

    speed_mps: float = 1.0
    climb_mps: float = 0.6
    yaw_rate_radps: float = 1.6
    ceiling_m: float = 2.4
    floor_m: float = 0.3
    step_m: float = 10.0
    critical_battery: float = 0.1
    stale_frame_s: float = 0.7
    stale_state_s: float = 1.5
    blind_s: float = 15.0
    link_lost_s: float = 10.0

    def __post_init__(self) -> None:
        if min(self.speed_mps, self.climb_mps, self.yaw_rate_radps, self.ceiling_m) <= 0:
            raise ValueRangeError(f"speed, climb, yaw-rate and ceiling must be positive: {self}")


@dataclass(frozen=True, kw_only=True)
class Circumstances:
    """What the rules depend on."""

    state: DroneState
    frame_age_s: float = 0.0  # inf before the first frame
    state_age_s: float = 0.0  # of the newest telemetry
    manual: bool = False  # a person at this machine took over
    abort: bool = False  # Ctrl-C, SIGTERM, a crashed mission, or a rule that lasted too long
    cut: bool = False  # a person wants the motors off, whatever falls

    @property
    def airborne(self) -> bool:
        """Whether it flies and follows commands."""
        return self.state.flying in AIRBORNE


@dataclass(frozen=True, kw_only=True)
class SafetyRule:
    """One line of the table."""

    override: Override
    holds: Callable[[Circumstances, Limits], bool]
    movement: Movement
    gimbal_too: bool = False  # whether the leaves still point the camera
    why: str  # for people and for the docs


SAFETY: Final = (
    SafetyRule(
        override=Override.CUT,
        holds=lambda now, _: now.cut,
        movement=CutMotors(),
        why="a person decided that falling is better",
    ),
    SafetyRule(
        override=Override.MANUAL,
        holds=lambda now, _: now.manual or now.state.pilot_has_control,
        movement=Release(),
        why="a pilot flies: nothing is sent and the mission waits, whatever else is wrong",
    ),
    SafetyRule(
        override=Override.ABORT,
        holds=lambda now, _: now.abort,
        movement=Land(),
        why="Ctrl-C, SIGTERM, a mission that crashed or ended in the air",
    ),
    SafetyRule(
        override=Override.BATTERY,
        holds=lambda now, limits: (
            now.airborne
            and now.state.battery is not None
            and now.state.battery < limits.critical_battery
        ),
        movement=Land(),
        why="the next thing the battery does is to land by itself, wherever that is",
    ),
    SafetyRule(
        override=Override.LINK,
        holds=lambda now, limits: (
            (now.airborne or now.state.flying is FlyingState.TAKING_OFF)
            and (not now.state.connected or now.state_age_s > limits.stale_state_s)
        ),
        movement=Hover(),
        why="what gets through should hold it still until it is heard again",
    ),
    SafetyRule(
        override=Override.STALE_FRAME,
        holds=lambda now, limits: now.airborne and now.frame_age_s > limits.stale_frame_s,
        movement=Hover(),
        gimbal_too=True,
        why="it flies by sight, and sees nothing new",
    ),
)


def rule_in_force(now: Circumstances, limits: Limits) -> SafetyRule | None:
    """Return the strongest rule that holds, None when the leaves have control authority."""
    return next((rule for rule in SAFETY if rule.holds(now, limits)), None)


class Arbiter:
    """Turns proposals and circumstances into the one command of the tick."""

    def __init__(self, limits: Limits) -> None:
        self._limits = limits
        self.override: Override | None = None  # the one in force since the last decision

    def decide(
        self,
        proposals: Proposals,
        now: Circumstances,
        correct: Callable[[Movement], Movement] | None = None,
    ) -> Command:
        """Return this tick's command.

        Args:
            proposals: of the leaves in this tick.
            now: what the safety rules depend on.
            correct: returns a movement as it should be flown, before it is limited.
        """
        rule = rule_in_force(now, self._limits)
        self.override = None if rule is None else rule.override
        if rule is None:
            movement = proposals.movement or Hover()
            movement = movement if correct is None else correct(movement)
            return Command(movement=self._clamp(movement, now.state), gimbal=proposals.gimbal)
        gimbal = proposals.gimbal if rule.gimbal_too else None
        return Command(movement=rule.movement, gimbal=gimbal)

    def _clamp(self, movement: Movement, state: DroneState) -> Movement:
        limits = self._limits
        # Down is positive: the most negative step that stays below the ceiling.
        headroom_m = max(0.0, limits.ceiling_m - state.height_above_carpet_m)
        if isinstance(movement, MoveBy):
            room_m = max(0.0, state.height_above_carpet_m - limits.floor_m)
            length_m = math.hypot(movement.forward_m, movement.right_m)
            shrink = min(1.0, limits.step_m / length_m) if length_m > 0 else 1.0
            return replace(
                movement,
                forward_m=movement.forward_m * shrink,
                right_m=movement.right_m * shrink,
                down_m=min(max(movement.down_m, -headroom_m), room_m),
                yaw_rad=min(max(movement.yaw_rad, -math.tau), math.tau),
            )
        if isinstance(movement, Velocity):
            horizontal = math.hypot(movement.forward_mps, movement.right_mps)
            shrink = min(1.0, limits.speed_mps / horizontal) if horizontal > 0 else 1.0
            climb_mps = limits.climb_mps if headroom_m > 0 else 0.0
            return Velocity(
                forward_mps=movement.forward_mps * shrink,
                right_mps=movement.right_mps * shrink,
                down_mps=min(max(movement.down_mps, -climb_mps), limits.climb_mps),
                yaw_rate_radps=min(
                    max(movement.yaw_rate_radps, -limits.yaw_rate_radps), limits.yaw_rate_radps
                ),
            )
        return movement


class Lasting:
    """How long something has held; a gap shorter than a second does not end it.

    A video that is late by just as much as it may be is fresh and stale in turn.
    """

    _GAP_S: Final = 1.0

    def __init__(self) -> None:
        self._since_s = self._last_s = -math.inf

    def update(self, now_s: float, *, holds: bool) -> float:
        """Return for how many seconds it has held.

        Args:
            now_s: mission clock.
            holds: whether it does in this tick.
        """
        if not holds:
            return 0.0
        if now_s - self._last_s > self._GAP_S:
            self._since_s = now_s
        self._last_s = now_s
        return now_s - self._since_s
