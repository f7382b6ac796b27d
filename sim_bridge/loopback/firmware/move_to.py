"""Flight to a point on earth: moveTo, with its orientation modes."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from sim_bridge.loopback.firmware.flight import AIRBORNE
from sim_bridge.loopback.firmware.part import Core, Part
from sim_bridge.loopback.firmware.publisher import Handler, Values
from sim_bridge.loopback.firmware.travel import Outcome, Step, Travelled, step_to
from sim_bridge.loopback.world import WorldState, offset_m
from uav_bt.types import wrap_angle

_NEAR_M: Final = 0.3  # so near a goal its direction is not worth a turn
_STATUS: Final = {
    Outcome.DONE: "DONE",
    Outcome.INTERRUPTED: "CANCELED",
    Outcome.REFUSED: "ERROR",
    Outcome.STUCK: "ERROR",
}


@dataclass(frozen=True, kw_only=True)
class _Goal:
    """A goal of moveTo."""

    asked: Mapping[str, Any]  # the command's arguments, as its event repeats them
    north_m: float
    east_m: float
    altitude_m: float


class MoveTo(Part):
    """Handles moveTo.

    Args:
        core: what the parts share.
    """

    def __init__(self, core: Core) -> None:
        super().__init__(core)
        self._goal: _Goal | None = None

    @property
    def running(self) -> bool:
        """Whether a moveTo runs."""
        return self._goal is not None

    def handlers(self) -> Mapping[str, Handler]:
        """Return the commands it handles, by name."""
        return {
            "ardrone3.Piloting.moveTo": self._move_to,
            "move.extended_move_to": self._move_to,
            "ardrone3.Piloting.CancelMoveTo": self._cancel,
        }

    def _move_to(self, values: Values, state: WorldState) -> None:
        numbers = {name: values[name] for name in ("latitude", "longitude", "altitude", "heading")}
        asked = numbers | {"orientation_mode": values["orientation_mode"].upper()}
        if state.flying not in AIRBORNE or not all(map(math.isfinite, numbers.values())):
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
        )
        self._publish(asked, "RUNNING")
        turn_rad = self._first_turn(goal, state)
        if turn_rad is None:
            self._cross(goal, state)
            return

        def turned(travelled: Travelled, then: WorldState) -> None:
            if travelled.outcome is Outcome.DONE and self._goal is goal:
                self._cross(goal, then)
            else:
                self._end(goal, travelled)

        self._core.travel.start(Step(yaw_rad=turn_rad), state, turned)

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
        self._core.travel.start(step, state, lambda travelled, _: self._end(goal, travelled))

    def _end(self, goal: _Goal, travelled: Travelled) -> None:
        if self._goal is goal:
            self._goal = None
            self._publish(goal.asked, _STATUS[travelled.outcome])

    def _cancel(self, _values: Values, state: WorldState) -> None:
        if self.running:
            self._core.travel.interrupt(state, hover=True)

    def _publish(self, asked: Mapping[str, Any], status: str) -> None:
        self._core.publisher.refresh("ardrone3.PilotingState.moveToChanged", **asked, status=status)
