"""Flying to a place on earth: moveTo, with its ways of turning on the way."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final

from sim_bridge.loopback.earth import offset_m
from sim_bridge.loopback.firmware.announcer import Announcer
from sim_bridge.loopback.firmware.flight import AIRBORNE
from sim_bridge.loopback.firmware.part import Handler, Values
from sim_bridge.loopback.firmware.settings import Settings
from sim_bridge.loopback.firmware.travel import Outcome, Step, Travel, Travelled
from sim_bridge.loopback.world import World, WorldState
from uav_bt.types import wrap_angle

__all__ = ["Places", "step_to"]

_EVENT: Final = "ardrone3.PilotingState.moveToChanged"
_ALTITUDE: Final = "ardrone3.PilotingSettingsState.MaxAltitudeChanged"
_NEAR_M: Final = 0.3  # so near a target no direction is worth turning to
_STATUS: Final = {
    Outcome.DONE: "DONE",
    Outcome.INTERRUPTED: "CANCELED",
    Outcome.REFUSED: "ERROR",
    Outcome.STUCK: "ERROR",
}


@dataclass(frozen=True, kw_only=True)
class _Errand:
    """Where to, and how."""

    told: Mapping[str, Any]  # as the client named it
    north_m: float
    east_m: float
    altitude_m: float


def step_to(
    state: WorldState, north_m: float, east_m: float, altitude_m: float, yaw_rad: float
) -> Step:
    """Return the relative movement that leads to a point.

    Args:
        state: where the drone is.
        north_m: the point, from the world's origin.
        east_m: likewise.
        altitude_m: above the take-off point.
        yaw_rad: the heading at the end, clockwise from north.
    """
    north, east = north_m - state.north_m, east_m - state.east_m
    heading = state.attitude.yaw_rad
    return Step(
        forward_m=north * math.cos(heading) + east * math.sin(heading),
        right_m=east * math.cos(heading) - north * math.sin(heading),
        down_m=state.altitude_m - altitude_m,
        yaw_rad=wrap_angle(yaw_rad - heading),
    )


class Places:
    """Obeys moveTo."""

    def __init__(
        self,
        announcer: Announcer,
        world: World,
        travel: Travel,
        settings: Settings,
        interrupt: Callable[[], None],
    ) -> None:
        """Go nowhere.

        Args:
            announcer: told how it goes.
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
        self._errand: _Errand | None = None

    @property
    def running(self) -> bool:
        """Whether a moveTo runs."""
        return self._errand is not None

    def handlers(self) -> Mapping[str, Handler]:
        """Return what obeys which command."""
        return {
            "ardrone3.Piloting.moveTo": self._move_to,
            "move.extended_move_to": self._move_to,
            "ardrone3.Piloting.CancelMoveTo": self._cancel,
        }

    def update(self, state: WorldState) -> None:
        """Movements are watched where they are carried out."""

    def _move_to(self, values: Values, state: WorldState) -> None:
        names = ("latitude", "longitude", "altitude", "orientation_mode", "heading")
        told = {name: values[name] for name in names}
        told["orientation_mode"] = told["orientation_mode"].upper()
        numbers = (told["latitude"], told["longitude"], told["altitude"], told["heading"])
        if state.flying not in AIRBORNE or not all(map(math.isfinite, numbers)):
            self._announcer.repeat(_EVENT, **told, status="ERROR")
            return
        self._errand = None  # a new place replaces the old one without a word about it
        self._interrupt()
        north_m, east_m = offset_m(told["latitude"], told["longitude"])
        ceiling = min(self._settings.value(_ALTITUDE), self._world.limits.ceiling_m)
        errand = _Errand(
            told=told, north_m=north_m, east_m=east_m, altitude_m=min(told["altitude"], ceiling)
        )
        self._errand = errand
        self._announcer.repeat(_EVENT, **told, status="RUNNING")
        turn_rad = self._first_turn(errand, state)
        if turn_rad is None:
            self._go(errand, state)
            return

        def turned(travelled: Travelled, then: WorldState) -> None:
            if travelled.outcome is Outcome.DONE and self._errand is errand:
                self._go(errand, then)
            else:
                self._ended(errand, travelled)

        self._travel.start(Step(yaw_rad=turn_rad), state, turned)

    def _first_turn(self, errand: _Errand, state: WorldState) -> float | None:
        mode, heading = errand.told["orientation_mode"], state.attitude.yaw_rad
        if mode == "HEADING_START":
            return wrap_angle(math.radians(errand.told["heading"]) - heading)
        north, east = errand.north_m - state.north_m, errand.east_m - state.east_m
        if mode == "TO_TARGET" and math.hypot(north, east) > _NEAR_M:
            return wrap_angle(math.atan2(east, north) - heading)
        return None

    def _go(self, errand: _Errand, state: WorldState) -> None:
        yaw_rad = state.attitude.yaw_rad
        if errand.told["orientation_mode"] == "HEADING_DURING":
            yaw_rad = math.radians(errand.told["heading"])
        step = step_to(state, errand.north_m, errand.east_m, errand.altitude_m, yaw_rad)
        self._travel.start(step, state, lambda travelled, _: self._ended(errand, travelled))

    def _ended(self, errand: _Errand, travelled: Travelled) -> None:
        if self._errand is errand:
            self._errand = None
            self._announcer.repeat(_EVENT, **errand.told, status=_STATUS[travelled.outcome])

    def _cancel(self, values: Values, state: WorldState) -> None:
        del values
        if self.running:
            self._travel.interrupt(state, hover=True)
