"""Taking off, landing, cutting out, and the flying state that the drone tells."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final

from sim_bridge.loopback.firmware.announcer import Announcer
from sim_bridge.loopback.firmware.part import Handler, Values
from sim_bridge.loopback.world import World, WorldState
from uav_bt.types import CutMotors, FlyingState, Land, TakeOff

__all__ = ["AIRBORNE", "Flight"]

AIRBORNE: Final = (FlyingState.HOVERING, FlyingState.FLYING)

_EVENT: Final = "ardrone3.PilotingState.FlyingStateChanged"
_EMERGENCY_S: Final = 0.5  # s for which a cut-out is told even where there was nothing to cut
_NAMES: Final = {
    FlyingState.LANDED: "landed",
    FlyingState.TAKING_OFF: "takingoff",
    FlyingState.HOVERING: "hovering",
    FlyingState.FLYING: "flying",
    FlyingState.LANDING: "landing",
    FlyingState.EMERGENCY: "emergency",
}


class Flight:
    """Obeys what starts and ends a flight."""

    def __init__(self, announcer: Announcer, world: World, interrupt: Callable[[], None]) -> None:
        """Stand on the ground.

        Args:
            announcer: told the flying state.
            world: what flies.
            interrupt: ends whatever moves the drone now.
        """
        self._announcer = announcer
        self._world = world
        self._interrupt = interrupt
        self._emergency_until_s = 0.0
        self.may_take_off = True  # no longer where the battery is empty

    def handlers(self) -> Mapping[str, Handler]:
        """Return what obeys which command."""
        return {
            "ardrone3.Piloting.TakeOff": self._take_off,
            "ardrone3.Piloting.UserTakeOff": self._user_take_off,
            "ardrone3.Piloting.Landing": self._land,
            "ardrone3.Piloting.SmartTakeOffLand": self._either,
            "ardrone3.Piloting.Emergency": self._cut_out,
        }

    def update(self, state: WorldState) -> None:
        """Tell the flying state."""
        if state.time_s < self._emergency_until_s:
            return
        name = _NAMES[state.flying]
        if state.flying is FlyingState.TAKING_OFF and not state.lifting:
            name = "motor_ramping"
        self._announcer.state(_EVENT, state=name)

    def land(self) -> None:
        """Land where it is."""
        self._interrupt()
        self._world.move(Land())

    def _take_off(self, values: Values, state: WorldState) -> None:
        del values
        if state.flying is FlyingState.LANDING or (
            state.flying is FlyingState.LANDED and self.may_take_off
        ):
            self._world.move(TakeOff())

    def _user_take_off(self, values: Values, state: WorldState) -> None:
        # Thrown from the hand it would start by itself; nobody throws this one.
        if values["state"]:
            self._take_off(values, state)
        elif state.flying is FlyingState.TAKING_OFF and not state.lifting:
            self.land()

    def _land(self, values: Values, state: WorldState) -> None:
        del values
        if state.flying not in (FlyingState.LANDED, FlyingState.EMERGENCY):
            self.land()

    def _either(self, values: Values, state: WorldState) -> None:
        if state.flying is FlyingState.LANDED:
            self._take_off(values, state)
        else:
            self._land(values, state)

    def _cut_out(self, values: Values, state: WorldState) -> None:
        del values
        self._interrupt()
        self._world.move(CutMotors())
        self._announcer.state(_EVENT, state="emergency")
        self._emergency_until_s = state.time_s + _EMERGENCY_S
