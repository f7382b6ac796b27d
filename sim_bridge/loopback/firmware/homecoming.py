"""Return-to-home: where home is, the way there, and what the drone does by itself when alone."""

from __future__ import annotations

import enum
import math
from collections.abc import Callable, Mapping
from typing import Final

from sim_bridge.loopback.earth import offset_m, place
from sim_bridge.loopback.firmware.announcer import Announcer
from sim_bridge.loopback.firmware.flight import AIRBORNE, Flight
from sim_bridge.loopback.firmware.part import Handler, Values
from sim_bridge.loopback.firmware.places import step_to
from sim_bridge.loopback.firmware.settings import Settings
from sim_bridge.loopback.firmware.travel import Outcome, Travel, Travelled
from sim_bridge.loopback.world import World, WorldState
from uav_bt.types import FlyingState

__all__ = ["Homecoming"]

_NO_PLACE: Final = 500.0  # what the drone says where it knows no latitude or longitude
_NEAR_M: Final = 0.5  # so near home it lands without climbing first
_REASONS: Final = {
    "user_request": "userRequest",
    "connection_lost": "connectionLost",
    "low_battery": "lowBattery",
    "finished": "finished",
    "stopped": "stopped",
    "disabled": "disabled",
    "enabled": "enabled",
}
_STATES: Final = {
    "available": "available",
    "in_progress": "inProgress",
    "unavailable": "unavailable",
    "pending": "pending",
}


class _Leg(enum.Enum):
    CLIMB = "climb"
    CROSS = "cross"
    DESCEND = "descend"


class Homecoming:
    """Brings the drone home when asked, or when it is alone for too long."""

    def __init__(
        self,
        announcer: Announcer,
        world: World,
        *,
        travel: Travel,
        settings: Settings,
        flight: Flight,
        interrupt: Callable[[], None],
    ) -> None:
        """Be at home.

        Args:
            announcer: told how it goes.
            world: what flies.
            travel: carries the movements out.
            settings: altitudes, delay and what to do at the end.
            flight: lands.
            interrupt: ends whatever else moves the drone.
        """
        self._announcer = announcer
        self._world = world
        self._travel = travel
        self._settings = settings
        self._flight = flight
        self._interrupt = interrupt
        self._leg: _Leg | None = None
        self._flying = False
        self._alone_since_s: float | None = None
        self._take_off_m: tuple[float, float] = (0.0, 0.0)
        self._custom_m: tuple[float, float] | None = None
        self._tell("unavailable", "disabled")
        self._tell_home()

    @property
    def running(self) -> bool:
        """Whether it is on its way."""
        return self._leg is not None

    def handlers(self) -> Mapping[str, Handler]:
        """Return what obeys which command."""
        return {
            "rth.return_to_home": lambda _, state: self.start(state, "user_request"),
            "rth.abort": lambda _, state: self.stop(state),
            "rth.set_custom_location": self._set_custom,
            "rth.cancel_auto_trigger": self._cancel_trigger,
            "ardrone3.Piloting.NavigateHome": self._navigate_home,
        }

    def start(self, state: WorldState, reason: str) -> None:
        """Set out for home."""
        if state.flying not in AIRBORNE or self.running:
            return
        self._interrupt()
        self._leg = _Leg.CLIMB
        self._tell("in_progress", reason)
        self._fly(state)

    def stop(self, state: WorldState) -> None:
        """Stay where it is now."""
        if self.running:
            self._leg = None
            self._travel.interrupt(state, hover=True)
            self._tell("available", "stopped")

    def interrupted(self) -> None:
        """Something else moves the drone now."""
        if self.running:
            self._leg = None
            self._tell("available", "stopped")

    def left_alone(self, now_s: float) -> None:
        """The client is gone."""
        self._alone_since_s = now_s

    def in_company(self) -> None:
        """A client is there."""
        self._alone_since_s = None

    def update(self, state: WorldState) -> None:
        """Note where flights begin; come home when alone for as long as is set."""
        flying = state.flying in (*AIRBORNE, FlyingState.TAKING_OFF)
        if flying and not self._flying:
            self._take_off_m = (state.north_m, state.east_m)
            self._tell_home()
            self._tell("available", "enabled")
        elif not flying and self._flying and state.flying is not FlyingState.LANDING:
            self._leg = None
            self._tell("unavailable", "disabled")
        if state.flying is not FlyingState.LANDING:
            self._flying = flying
        alone = self._alone_since_s
        if alone is not None and state.time_s - alone > self._settings.value("rth.delay", "delay"):
            self._alone_since_s = None
            self.start(state, "connection_lost")

    def _fly(self, state: WorldState) -> None:
        north_m, east_m = self._custom_m or self._take_off_m
        away_m = math.hypot(north_m - state.north_m, east_m - state.east_m)
        ceiling = self._world.limits.ceiling_m
        highest = min(self._settings.value("rth.min_altitude"), ceiling)
        yaw, altitude = state.attitude.yaw_rad, max(state.altitude_m, highest)
        if self._leg is _Leg.CLIMB:
            altitude = state.altitude_m if away_m < _NEAR_M else altitude
            step = step_to(state, state.north_m, state.east_m, altitude, yaw)
        elif self._leg is _Leg.CROSS:
            if away_m > _NEAR_M:
                yaw = math.atan2(east_m - state.east_m, north_m - state.north_m)
            step = step_to(state, north_m, east_m, state.altitude_m, yaw)
        else:
            altitude = min(
                self._settings.value("rth.ending_hovering_altitude"), ceiling, state.altitude_m
            )
            step = step_to(state, state.north_m, state.east_m, altitude, yaw)
        self._travel.start(step, state, self._flown)

    def _flown(self, travelled: Travelled, state: WorldState) -> None:
        if self._leg is None:
            return
        if travelled.outcome is not Outcome.DONE:
            self.interrupted()
        elif self._leg is _Leg.CLIMB:
            self._leg = _Leg.CROSS
            self._fly(state)
        elif self._leg is _Leg.DESCEND:
            self._finish()
        elif self._settings.value("rth.ending_behavior", "ending_behavior") == "landing":
            self._finish()
            self._flight.land()
        else:
            self._leg = _Leg.DESCEND
            self._fly(state)

    def _finish(self) -> None:
        self._leg = None
        self._tell("available", "finished")

    def _navigate_home(self, values: Values, state: WorldState) -> None:
        if values["start"]:
            self.start(state, "user_request")
        else:
            self.stop(state)

    def _set_custom(self, values: Values, state: WorldState) -> None:
        del state
        if math.isfinite(values["latitude"]) and math.isfinite(values["longitude"]):
            self._custom_m = offset_m(values["latitude"], values["longitude"])
            self._announcer.repeat("rth.custom_location", **values)
            self._tell_home()

    def _cancel_trigger(self, values: Values, state: WorldState) -> None:
        del values, state
        self._announcer.repeat("rth.rth_auto_trigger", reason="none", delay=0)

    def _tell(self, state: str, reason: str) -> None:
        self._announcer.state("rth.state", state=state, reason=reason)
        self._announcer.state(
            "ardrone3.PilotingState.NavigateHomeStateChanged",
            state=_STATES[state],
            reason=_REASONS[reason],
        )

    def _tell_home(self) -> None:
        north_m, east_m = self._custom_m or self._take_off_m
        home, start = place(north_m, east_m), place(*self._take_off_m)
        tell = self._announcer.state
        tell("rth.home_type", type="custom" if self._custom_m else "takeoff")
        tell(
            "rth.takeoff_location",
            latitude=start.latitude_deg,
            longitude=start.longitude_deg,
            altitude=0.0,
            fixed_before_takeoff=1,
        )
        there = {"latitude": home.latitude_deg, "longitude": home.longitude_deg, "altitude": 0.0}
        tell("rth.home_location", **there)
        tell("ardrone3.GPSSettingsState.HomeChanged", **there)
        if self._custom_m is None:
            nowhere = {"latitude": _NO_PLACE, "longitude": _NO_PLACE, "altitude": _NO_PLACE}
            tell("rth.custom_location", **nowhere)
        tell("rth.home_reachability", status="reachable")
