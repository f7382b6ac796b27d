"""The arbiter: one command per tick, by the safety rules first, then by the leaves' proposals.

The strongest rule that holds decides the tick; without one the leaves decide. A condition that
lasts too long becomes an abort, which is a landing (`contingencies.py`). A test walks the table,
rule by rule.

No automatic rule takes back a landing. A landing that is under way, or that a leaf proposes, goes
on with old frames and old telemetry, as the drone's own landing; a pilot and the motor cut end it.

The drone has rules of its firmware besides. An ANAFI without commands from a program centres its
sticks and hovers at once. It lands or returns, as set, when the link stays lost or the battery is
empty. These rules also hold after the program has died.
"""

from __future__ import annotations

import enum
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from uav_bt.board.context import Proposals
from uav_bt.board.keys import FRAME, STATE
from uav_bt.mission.limits import AreaGuard, Limits, limit_movement
from uav_bt.types import Airframe, Command, DroneState, FlyingState, Movement, Pose2D
from uav_bt.types.area import Area
from uav_bt.types.commands import CutMotors, Hover, Land, MoveBy, Release, TakeOff

AIRBORNE: Final = frozenset({FlyingState.HOVERING, FlyingState.FLYING})


class Override(enum.Enum):
    """The overrides of the leaves, strongest first."""

    CUT = "motors cut"
    MANUAL = "manual take-over"
    ABORT = "abort"
    BATTERY = "critical battery"
    LINK = "link lost"
    STALE_FRAME = "stale frame"


@dataclass(frozen=True, kw_only=True)
class Circumstances:
    """The input of the rules."""

    state: DroneState  # newest telemetry
    frame_age_s: float = 0.0  # of the newest frame; inf before the first one
    state_age_s: float = 0.0
    manual: bool = False  # a person at this machine took over
    abort: bool = False  # the mission is being aborted
    cut: bool = False  # a person orders the motors off, wherever the drone falls
    place: Pose2D | None = None  # relative to the take-off pose; None where it is unknown


def safety_rules(now: Circumstances, limits: Limits) -> tuple[tuple[bool, Override, Movement], ...]:
    """Return the table, strongest rule first: whether it holds, its override, what is sent."""
    state, airborne = now.state, now.state.flying in AIRBORNE
    low = state.battery is not None and state.battery < limits.critical_battery
    unheard = not state.connected or now.state_age_s > STATE.max_age_s
    rising = state.flying is FlyingState.TAKING_OFF
    return (
        # A person decided that falling is better.
        (now.cut, Override.CUT, CutMotors()),
        # A pilot flies: nothing is sent and the mission waits, whatever else is wrong.
        (now.manual or state.pilot_has_control, Override.MANUAL, Release()),
        # Ctrl-C, SIGTERM, a mission that crashed or ended in the air.
        (now.abort, Override.ABORT, Land()),
        # With an empty battery the drone lands by itself, wherever that is.
        (airborne and low, Override.BATTERY, Land()),
        # Commands may still arrive: hover, or go on landing, until telemetry returns.
        ((airborne or rising) and unheard, Override.LINK, Hover()),
        # Without a new image the way is unknown; a landing needs none.
        (airborne and now.frame_age_s > FRAME.max_age_s, Override.STALE_FRAME, Hover()),
    )


class Arbiter:
    """Turns proposals and circumstances into the one command of the tick.

    Movements stay in the area; a `grounded` mission's rules forbid a take-off.
    """

    def __init__(
        self,
        limits: Limits,
        airframe: Airframe | None = None,
        *,
        area: Area | None = None,
        grounded: bool = False,
    ) -> None:
        self._limits = limits
        self._airframe = airframe or Airframe()
        self._guard = None if area is None else AreaGuard(area, airframe)
        self._grounded = grounded
        self.override: Override | None = None  # the one in force since the last decision
        self.landing = False  # whether the last decision was to land
        self.is_held = True  # whether the position hold corrected the last decision

    def decide(
        self,
        proposals: Proposals,
        now: Circumstances,
        correct: Callable[[Movement], Movement] = lambda movement: movement,
        hover: Callable[[], Movement] = Hover,
    ) -> Command:
        """Return this tick's command.

        `correct` returns a proposed movement as it should be flown, before it is limited, `hover`
        the hover that rules without a usable frame or telemetry order.
        """
        holding = (rule[1:] for rule in safety_rules(now, self._limits) if rule[0])
        self.override, ordered = next(holding, (None, None))
        hovers = ordered == Hover()
        self.is_held = ordered is None or hovers
        if ordered is None:
            return self._proposed(proposals, now, correct)
        lands = hovers and (self.landing or isinstance(proposals.movement, Land))
        movement = Land() if lands else ordered
        self.landing = isinstance(movement, Land)
        if hovers and not lands:
            movement = hover()
        # With an old frame the leaves still point the camera, which may end it.
        gimbal = proposals.gimbal if self.override is Override.STALE_FRAME else None
        return Command(movement=movement, gimbal=gimbal)

    def _proposed(
        self, proposals: Proposals, now: Circumstances, correct: Callable[[Movement], Movement]
    ) -> Command:
        movement = proposals.movement
        if movement is None:
            # A leaf without fresh telemetry proposes nothing; the landing continues.
            lands = self.landing and now.state.flying is FlyingState.LANDING
            movement = Land() if lands else Hover()
        if self._grounded and isinstance(movement, TakeOff):
            movement = Hover()
        self.landing = isinstance(movement, Land)
        if self._guard is not None and isinstance(movement, MoveBy):
            # Before the position hold, which keeps the goal of the movement afterwards.
            movement = self._guard.limited(movement, now.place)
        movement = limit_movement(
            correct(movement),
            now.state,
            self._limits,
            self._airframe,
            state_age_s=now.state_age_s,
            landing=self.landing,
        )
        if self._guard is not None and not isinstance(movement, MoveBy):
            movement = self._guard.limited(movement, now.place, age_s=now.state_age_s)
        return Command(movement=movement, gimbal=proposals.gimbal)


class Lasting:
    """Measures for how long a condition has held; a gap shorter than `gap_s` does not end it.

    So a video whose latency lies at its limit, fresh and stale in turn, counts as stale throughout.
    With a gap of 0 the first tick in which the condition does not hold ends it.
    """

    def __init__(self, *, gap_s: float = 1.0) -> None:
        self._gap_s = gap_s
        self._since_s: float | None = None  # None: it does not hold
        self._last_s = 0.0  # last time at which it held

    def update(self, now_s: float, *, holds: bool) -> float:
        """Return the seconds for which the condition has held, 0 if it does not hold now."""
        ends = self._gap_s > 0.0 or not holds
        if ends and now_s - self._last_s > self._gap_s:
            self._since_s = None
        if not holds:
            return 0.0
        if self._since_s is None:
            self._since_s = now_s
        self._last_s = now_s
        return now_s - self._since_s

    def reset(self) -> None:
        """Restart, as if the condition had not held."""
        self._since_s = None
