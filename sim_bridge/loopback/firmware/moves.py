"""Relative movements: moveBy, and extended_move_by with its own speeds."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import astuple, replace
from typing import Final

from sim_bridge.loopback.codec import Values
from sim_bridge.loopback.firmware.flight import AIRBORNE, Flight
from sim_bridge.loopback.firmware.travel import Outcome, Step
from sim_bridge.loopback.world import WorldState
from sim_bridge.twin.reference import Pace
from uav_bt.types import FlyingState

_CHANGED: Final = "ardrone3.PilotingState.moveByChanged"
_END: Final = "ardrone3.PilotingEvent.moveByEnd"
_RESULTS: Final = {  # status of moveByChanged, error of moveByEnd
    Outcome.DONE: ("DONE", "ok"),
    Outcome.INTERRUPTED: ("CANCELED", "interrupted"),
    Outcome.REFUSED: ("ERROR", "notAvailable"),
    Outcome.STUCK: ("ERROR", "unknown"),
}


class MoveBy:
    """Handles moveBy and extended_move_by."""

    def __init__(self, flight: Flight) -> None:
        self._flight = flight
        self.handlers = {
            "ardrone3.Piloting.moveBy": self._move_by,
            "move.extended_move_by": self._extended_move_by,
        }

    def _move_by(self, values: Values, state: WorldState) -> None:
        self._start([values[name] for name in ("dX", "dY", "dZ", "dPsi")], state)

    def _extended_move_by(self, values: Values, state: WorldState) -> None:
        parts = [values[name] for name in ("d_x", "d_y", "d_z", "d_psi")]
        needed = (bool(parts[0] or parts[1]), bool(parts[2]), bool(parts[3]))
        pace = slowed(self._flight.pace, values, needed)
        if pace is None:
            self._notify_end(Step(), "unknown")
        else:
            self._start(parts, state, pace)

    def _start(self, parts: Sequence[float], state: WorldState, pace: Pace | None = None) -> None:
        if state.flying not in AIRBORNE or not all(map(math.isfinite, parts)):
            busy = state.flying in (FlyingState.TAKING_OFF, FlyingState.LANDING)
            self._notify_end(Step(), "busy" if busy else "notAvailable")
            return
        asked = dict(zip(("dXAsked", "dYAsked", "dZAsked", "dPsiAsked"), parts, strict=True))
        publish = self._flight.states.notify

        def ended(outcome: Outcome, done: Step) -> None:
            status, error = _RESULTS[outcome]
            publish(_CHANGED, **asked, **_arguments(done), status=status)
            self._notify_end(done, error)

        forward_m, right_m, down_m, yaw_rad = parts
        highest_m = min(0.0, state.altitude_m - self._flight.ceiling_m)
        step = Step(
            forward_m=forward_m, right_m=right_m, down_m=max(down_m, highest_m), yaw_rad=yaw_rad
        )
        self._flight.interrupt()
        publish(_CHANGED, **asked, **_arguments(Step()), status="RUNNING")
        self._flight.travel_on([lambda _: step], pace or self._flight.pace, ended)

    def _notify_end(self, done: Step, error: str) -> None:
        self._flight.states.notify(_END, **_arguments(done), error=error)


def slowed(pace: Pace, values: Values, needed: Sequence[bool]) -> Pace | None:
    """Return a pace within the speeds of an extended movement.

    `needed` tells whether the movement has a horizontal part, a vertical part and a turn. None is
    returned if a needed speed, or each speed, is not a positive number.
    """
    speeds = [values[f"max_{name}_speed"] for name in ("horizontal", "vertical", "yaw_rotation")]
    speeds[2] = math.radians(speeds[2])
    usable = [math.isfinite(speed) and speed > 0.0 for speed in speeds]
    if not any(usable) or any(need and not use for need, use in zip(needed, usable, strict=True)):
        return None
    limits = [
        min(limit, speed) if use else limit
        for limit, speed, use in zip(astuple(pace), speeds, usable, strict=True)
    ]
    return replace(pace, speed_mps=limits[0], climb_mps=limits[1], yaw_rate_radps=limits[2])


def _arguments(step: Step) -> dict[str, float]:
    return {"dX": step.forward_m, "dY": step.right_m, "dZ": step.down_m, "dPsi": step.yaw_rad}
