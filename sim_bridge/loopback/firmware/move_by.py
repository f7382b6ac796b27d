"""Relative movements: moveBy, its end event, and what interrupts it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Final

from sim_bridge.loopback.firmware.flight import AIRBORNE
from sim_bridge.loopback.firmware.part import Core, Part
from sim_bridge.loopback.firmware.publisher import Handler, Values
from sim_bridge.loopback.firmware.travel import Outcome, Step, Travelled
from sim_bridge.loopback.world import WorldState
from uav_bt.types import FlyingState

_RESULTS: Final = {  # of moveByChanged and of moveByEnd
    Outcome.DONE: ("DONE", "ok"),
    Outcome.INTERRUPTED: ("CANCELED", "interrupted"),
    Outcome.REFUSED: ("ERROR", "notAvailable"),
    Outcome.STUCK: ("ERROR", "unknown"),
}


class MoveBy(Part):
    """Handles moveBy.

    Args:
        core: what the parts share.
    """

    def __init__(self, core: Core) -> None:
        super().__init__(core)
        self._running = False

    def handlers(self) -> Mapping[str, Handler]:
        """Return the commands it handles, by name."""
        return {
            "ardrone3.Piloting.moveBy": self._move_by,
            "move.extended_move_by": self._extended_move_by,
            "ardrone3.Piloting.CancelMoveBy": self._cancel,
        }

    def _move_by(self, values: Values, state: WorldState) -> None:
        self._start(*(values[name] for name in ("dX", "dY", "dZ", "dPsi")), state=state)

    def _extended_move_by(self, values: Values, state: WorldState) -> None:
        self._start(*(values[name] for name in ("d_x", "d_y", "d_z", "d_psi")), state=state)

    def _start(self, *displacement: float, state: WorldState) -> None:
        if state.flying not in AIRBORNE or not all(map(math.isfinite, displacement)):
            busy = state.flying in (FlyingState.TAKING_OFF, FlyingState.LANDING)
            self._notify_end(Step(), "busy" if busy else "notAvailable")
            return
        forward_m, right_m, down_m, yaw_rad = displacement
        asked = Step(forward_m=forward_m, right_m=right_m, down_m=down_m, yaw_rad=yaw_rad)
        self._core.interrupt()

        def ended(travelled: Travelled, _: WorldState) -> None:
            self._running = False
            status, error = _RESULTS[travelled.outcome]
            self._publish_change(asked, travelled.done, status)
            self._notify_end(travelled.done, error)

        self._running = True
        self._publish_change(asked, Step(), "RUNNING")
        min_down_m = min(0.0, state.altitude_m - self._core.ceiling_m)
        self._core.travel.start(replace(asked, down_m=max(down_m, min_down_m)), state, ended)

    def _cancel(self, _values: Values, state: WorldState) -> None:
        if self._running:
            self._core.travel.interrupt(state, hover=True)

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


def _arguments(step: Step) -> dict[str, float]:
    return {"dX": step.forward_m, "dY": step.right_m, "dZ": step.down_m, "dPsi": step.yaw_rad}
