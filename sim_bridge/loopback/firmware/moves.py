"""Relative movements: moveBy, its end event, and what interrupts it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Final

from sim_bridge.loopback.firmware.announcer import Announcer
from sim_bridge.loopback.firmware.flight import AIRBORNE
from sim_bridge.loopback.firmware.part import Handler, Values
from sim_bridge.loopback.firmware.settings import Settings
from sim_bridge.loopback.firmware.travel import Outcome, Step, Travel, Travelled
from sim_bridge.loopback.world import World, WorldState
from uav_bt.types import FlyingState

__all__ = ["Moves"]

_CHANGED: Final = "ardrone3.PilotingState.moveByChanged"
_END: Final = "ardrone3.PilotingEvent.moveByEnd"
_ALTITUDE: Final = "ardrone3.PilotingSettingsState.MaxAltitudeChanged"
_ERRORS: Final = {
    Outcome.DONE: ("DONE", "ok"),
    Outcome.INTERRUPTED: ("CANCELED", "interrupted"),
    Outcome.REFUSED: ("ERROR", "notAvailable"),
    Outcome.STUCK: ("ERROR", "unknown"),
}


class Moves:
    """Obeys moveBy."""

    def __init__(
        self,
        announcer: Announcer,
        world: World,
        travel: Travel,
        settings: Settings,
        interrupt: Callable[[], None],
    ) -> None:
        """Stand still.

        Args:
            announcer: told how movements go.
            world: what flies.
            travel: carries the movements out.
            settings: the greatest altitude.
            interrupt: ends whatever else moves the drone.
        """
        self._announcer = announcer
        self._world = world
        self._travel = travel
        self._settings = settings
        self._interrupt = interrupt
        self._running = False

    @property
    def running(self) -> bool:
        """Whether a moveBy runs."""
        return self._running

    def handlers(self) -> Mapping[str, Handler]:
        """Return what obeys which command."""
        return {
            "ardrone3.Piloting.moveBy": self._move_by,
            "move.extended_move_by": self._extended_move_by,
            "ardrone3.Piloting.CancelMoveBy": self._cancel,
        }

    def update(self, state: WorldState) -> None:
        """Movements are watched where they are carried out."""

    def _move_by(self, values: Values, state: WorldState) -> None:
        step = Step(
            forward_m=values["dX"],
            right_m=values["dY"],
            down_m=values["dZ"],
            yaw_rad=values["dPsi"],
        )
        self._begin(step, state)

    def _extended_move_by(self, values: Values, state: WorldState) -> None:
        step = Step(
            forward_m=values["d_x"],
            right_m=values["d_y"],
            down_m=values["d_z"],
            yaw_rad=values["d_psi"],
        )
        self._begin(step, state)

    def _begin(self, asked: Step, state: WorldState) -> None:
        parts = (asked.forward_m, asked.right_m, asked.down_m, asked.yaw_rad)
        if state.flying not in AIRBORNE or not all(map(math.isfinite, parts)):
            busy = state.flying in (FlyingState.TAKING_OFF, FlyingState.LANDING)
            self._tell_end(Step(), "busy" if busy else "notAvailable")
            return
        self._interrupt()

        def ended(travelled: Travelled, _: WorldState) -> None:
            self._running = False
            status, error = _ERRORS[travelled.outcome]
            self._tell_change(asked, travelled.done, status)
            self._tell_end(travelled.done, error)

        self._running = True
        self._tell_change(asked, Step(), "RUNNING")
        ceiling = min(self._settings.value(_ALTITUDE), self._world.limits.ceiling_m)
        lowest_down_m = min(0.0, state.altitude_m - ceiling)
        flown = Step(
            forward_m=asked.forward_m,
            right_m=asked.right_m,
            down_m=max(asked.down_m, lowest_down_m),
            yaw_rad=asked.yaw_rad,
        )
        self._travel.start(flown, state, ended)

    def _cancel(self, values: Values, state: WorldState) -> None:
        del values
        if self._running:
            self._travel.interrupt(state, hover=True)

    def _tell_change(self, asked: Step, done: Step, status: str) -> None:
        self._announcer.repeat(
            _CHANGED,
            dXAsked=asked.forward_m,
            dYAsked=asked.right_m,
            dZAsked=asked.down_m,
            dPsiAsked=asked.yaw_rad,
            dX=done.forward_m,
            dY=done.right_m,
            dZ=done.down_m,
            dPsi=done.yaw_rad,
            status=status,
        )

    def _tell_end(self, done: Step, error: str) -> None:
        self._announcer.note(
            _END,
            dX=done.forward_m,
            dY=done.right_m,
            dZ=done.down_m,
            dPsi=done.yaw_rad,
            error=error,
        )
