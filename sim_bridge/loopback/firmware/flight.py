"""Take-off, landing, emergency stop, and the flying state."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from sim_bridge.loopback.firmware.part import Core, Part
from sim_bridge.loopback.firmware.publisher import Handler, Values
from sim_bridge.loopback.world import WorldState
from uav_bt.types import CutMotors, FlyingState, Land, TakeOff

AIRBORNE: Final = (FlyingState.HOVERING, FlyingState.FLYING)

_EVENT: Final = "ardrone3.PilotingState.FlyingStateChanged"
# s for which an emergency stop is published even on the ground: clients wait for the state.
_EMERGENCY_S: Final = 0.5
_NAMES: Final = {
    FlyingState.LANDED: "landed",
    FlyingState.TAKING_OFF: "takingoff",
    FlyingState.HOVERING: "hovering",
    FlyingState.FLYING: "flying",
    FlyingState.LANDING: "landing",
    FlyingState.EMERGENCY: "emergency",
}


class Flight(Part):
    """Starts and ends flights.

    Args:
        core: what the parts share.
    """

    def __init__(self, core: Core) -> None:
        super().__init__(core)
        self._emergency_until_s = 0.0
        self.may_take_off = True  # False while the battery is critical

    def handlers(self) -> Mapping[str, Handler]:
        """Return the commands it handles, by name."""
        return {
            "ardrone3.Piloting.TakeOff": self._take_off,
            "ardrone3.Piloting.UserTakeOff": self._user_take_off,
            "ardrone3.Piloting.Landing": self._land,
            "ardrone3.Piloting.SmartTakeOffLand": self._take_off_or_land,
            "ardrone3.Piloting.Emergency": self._stop_motors,
        }

    def update(self, state: WorldState) -> None:
        """Publish the flying state."""
        if state.time_s < self._emergency_until_s:
            return
        name = _NAMES[state.flying]
        if state.flying is FlyingState.TAKING_OFF and not state.lifting:
            name = "motor_ramping"
        self._core.publisher.state(_EVENT, state=name)

    def land(self) -> None:
        """Land at the present position."""
        self._core.interrupt()
        self._core.world.move(Land())

    def _take_off(self, _values: Values, state: WorldState) -> None:
        if state.flying is FlyingState.LANDING or (
            state.flying is FlyingState.LANDED and self.may_take_off
        ):
            self._core.world.move(TakeOff())

    def _user_take_off(self, values: Values, state: WorldState) -> None:
        # A real drone waits with spinning motors to be thrown; this one takes off at once.
        if values["state"]:
            self._take_off(values, state)
        elif state.flying is FlyingState.TAKING_OFF and not state.lifting:
            self.land()

    def _land(self, _values: Values, state: WorldState) -> None:
        if state.flying not in (FlyingState.LANDED, FlyingState.EMERGENCY):
            self.land()

    def _take_off_or_land(self, values: Values, state: WorldState) -> None:
        if state.flying is FlyingState.LANDED:
            self._take_off(values, state)
        else:
            self._land(values, state)

    def _stop_motors(self, _values: Values, state: WorldState) -> None:
        self._core.interrupt()
        self._core.world.move(CutMotors())
        self._core.publisher.state(_EVENT, state="emergency")
        self._emergency_until_s = state.time_s + _EMERGENCY_S
