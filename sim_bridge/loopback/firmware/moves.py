"""Flights to a point: moveBy to a displacement, moveTo to a geographic position."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import astuple, dataclass, replace
from typing import Any, Final

from sim_bridge.loopback.firmware.core import Core, Outcome, Part, Step, step_to
from sim_bridge.loopback.firmware.piloting import AIRBORNE
from sim_bridge.loopback.firmware.publisher import Values
from sim_bridge.loopback.world import WorldState, offset_m
from sim_bridge.twin.reference import Pace
from uav_bt.types import FlyingState, wrap_angle

_RESULTS: Final = {  # status of moveByChanged, error of moveByEnd
    Outcome.DONE: ("DONE", "ok"),
    Outcome.INTERRUPTED: ("CANCELED", "interrupted"),
    Outcome.REFUSED: ("ERROR", "notAvailable"),
    Outcome.STUCK: ("ERROR", "unknown"),
}


class MoveBy(Part):
    """Handles moveBy."""

    def __init__(self, core: Core) -> None:
        super().__init__(core)
        self.handlers = {
            "ardrone3.Piloting.moveBy": self._move_by,
            "move.extended_move_by": self._extended_move_by,
        }

    def _move_by(self, values: Values, state: WorldState) -> None:
        displacement = [values[name] for name in ("dX", "dY", "dZ", "dPsi")]
        self._start(*displacement, state=state, pace=self._core.pace)

    def _extended_move_by(self, values: Values, state: WorldState) -> None:
        displacement = [values[name] for name in ("d_x", "d_y", "d_z", "d_psi")]
        forward_m, right_m, down_m, yaw_rad = displacement
        needed = (bool(forward_m or right_m), bool(down_m), bool(yaw_rad))
        pace = _slowed(self._core.pace, values, needed)
        if pace is None:
            self._notify_end(Step(), "unknown")
        else:
            self._start(*displacement, state=state, pace=pace)

    def _start(self, *displacement: float, state: WorldState, pace: Pace) -> None:
        if state.flying not in AIRBORNE or not all(map(math.isfinite, displacement)):
            busy = state.flying in (FlyingState.TAKING_OFF, FlyingState.LANDING)
            self._notify_end(Step(), "busy" if busy else "notAvailable")
            return
        forward_m, right_m, down_m, yaw_rad = displacement
        asked = Step(forward_m=forward_m, right_m=right_m, down_m=down_m, yaw_rad=yaw_rad)
        self._core.interrupt()

        def ended(outcome: Outcome, done: Step, _: WorldState) -> None:
            status, error = _RESULTS[outcome]
            self._publish_change(asked, done, status)
            self._notify_end(done, error)

        self._publish_change(asked, Step(), "RUNNING")
        min_down_m = min(0.0, state.altitude_m - self._core.ceiling_m)
        bounded = replace(asked, down_m=max(down_m, min_down_m))
        self._core.travel.start(bounded, state, ended, pace)

    def _publish_change(self, asked: Step, done: Step, status: str) -> None:
        self._core.publisher.refresh(
            "ardrone3.PilotingState.moveByChanged",
            dXAsked=asked.forward_m,
            dYAsked=asked.right_m,
            dZAsked=asked.down_m,
            dPsiAsked=asked.yaw_rad,
            **_arguments(done),
            status=status,
        )

    def _notify_end(self, done: Step, error: str) -> None:
        self._core.publisher.notify(
            "ardrone3.PilotingEvent.moveByEnd", **_arguments(done), error=error
        )


def _slowed(pace: Pace, values: Values, needed: Sequence[bool]) -> Pace | None:
    """Return a pace within the speeds of an extended movement.

    Args:
        pace: speed limits of all movements.
        values: arguments of the command.
        needed: whether the movement has a horizontal part, a vertical part and a turn.

    Returns:
        None if a needed speed, or each speed, is not a positive number.
    """
    named = [values[f"max_{name}_speed"] for name in ("horizontal", "vertical", "yaw_rotation")]
    named[2] = math.radians(named[2])
    usable = [math.isfinite(speed) and speed > 0.0 for speed in named]
    if not any(usable) or any(need and not use for need, use in zip(needed, usable, strict=True)):
        return None
    speeds = [
        min(limit, speed) if use else limit
        for limit, speed, use in zip(astuple(pace), named, usable, strict=True)
    ]
    return Pace(speed_mps=speeds[0], climb_mps=speeds[1], yaw_rate_radps=speeds[2])


def _arguments(step: Step) -> dict[str, float]:
    return {"dX": step.forward_m, "dY": step.right_m, "dZ": step.down_m, "dPsi": step.yaw_rad}


_NEAR_M: Final = 0.3  # within this distance of a goal the drone does not turn towards it
_STATUS: Final = {
    Outcome.DONE: "DONE",
    Outcome.INTERRUPTED: "CANCELED",
    Outcome.REFUSED: "ERROR",
    Outcome.STUCK: "ERROR",
}


@dataclass(frozen=True, kw_only=True)
class _Goal:
    """A goal of moveTo."""

    asked: Mapping[str, Any]  # arguments of the command; its event repeats them
    north_m: float
    east_m: float
    altitude_m: float
    pace: Pace


class MoveTo(Part):
    """Handles moveTo."""

    def __init__(self, core: Core) -> None:
        super().__init__(core)
        self.handlers = {
            "ardrone3.Piloting.moveTo": self._move_to,
            "move.extended_move_to": self._extended_move_to,
        }
        self._goal: _Goal | None = None

    @property
    def running(self) -> bool:
        """Whether a moveTo runs."""
        return self._goal is not None

    def _extended_move_to(self, values: Values, state: WorldState) -> None:
        # The vertical and yaw parts are unknown here; only the drone knows its position.
        self._go(values, state, _slowed(self._core.pace, values, (True, False, False)))

    def _move_to(self, values: Values, state: WorldState) -> None:
        self._go(values, state, self._core.pace)

    def _go(self, values: Values, state: WorldState, pace: Pace | None) -> None:
        numbers = {name: values[name] for name in ("latitude", "longitude", "altitude", "heading")}
        asked = numbers | {"orientation_mode": values["orientation_mode"].upper()}
        known = self._core.gps and all(map(math.isfinite, numbers.values()))
        if state.flying not in AIRBORNE or not known or pace is None:
            self._publish(asked, "ERROR")
            return
        self._goal = None  # a new goal replaces the old one without an event
        self._core.interrupt()
        north_m, east_m = offset_m(asked["latitude"], asked["longitude"])
        goal = self._goal = _Goal(
            asked=asked,
            north_m=north_m,
            east_m=east_m,
            altitude_m=min(asked["altitude"], self._core.ceiling_m),
            pace=pace,
        )
        self._publish(asked, "RUNNING")
        turn_rad = self._first_turn(goal, state)
        if turn_rad is None:
            self._cross(goal, state)
            return

        def turned(outcome: Outcome, _: Step, then: WorldState) -> None:
            if outcome is Outcome.DONE and self._goal is goal:
                self._cross(goal, then)
            else:
                self._end(goal, outcome)

        self._core.travel.start(Step(yaw_rad=turn_rad), state, turned, goal.pace)

    def _first_turn(self, goal: _Goal, state: WorldState) -> float | None:
        mode, heading = goal.asked["orientation_mode"], state.attitude.yaw_rad
        if mode == "HEADING_START":
            return wrap_angle(math.radians(goal.asked["heading"]) - heading)
        north, east = goal.north_m - state.north_m, goal.east_m - state.east_m
        if mode == "TO_TARGET" and math.hypot(north, east) > _NEAR_M:
            return wrap_angle(math.atan2(east, north) - heading)
        return None

    def _cross(self, goal: _Goal, state: WorldState) -> None:
        yaw_rad = state.attitude.yaw_rad
        if goal.asked["orientation_mode"] == "HEADING_DURING":
            yaw_rad = math.radians(goal.asked["heading"])
        step = step_to(state, goal.north_m, goal.east_m, goal.altitude_m, yaw_rad)
        self._core.travel.start(
            step, state, lambda outcome, *_: self._end(goal, outcome), goal.pace
        )

    def _end(self, goal: _Goal, outcome: Outcome) -> None:
        if self._goal is goal:
            self._goal = None
            self._publish(goal.asked, _STATUS[outcome])

    def _publish(self, asked: Mapping[str, Any], status: str) -> None:
        self._core.publisher.refresh("ardrone3.PilotingState.moveToChanged", **asked, status=status)
