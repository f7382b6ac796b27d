"""Flights to a place on earth: moveTo, and the return home. They need a GPS fix."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import partial
from typing import Any, Final

from sim_bridge.loopback.codec import Values
from sim_bridge.loopback.firmware.flight import AIRBORNE, Flight
from sim_bridge.loopback.firmware.moves import slowed
from sim_bridge.loopback.firmware.travel import Leg, Outcome, Step, step_to
from sim_bridge.loopback.world import WorldState, location, offset_m
from sim_bridge.twin.reference import Pace
from uav_bt.types import FlyingState, wrap_angle

UNKNOWN: Final = 500.0  # ARSDK's value of an unknown latitude, longitude or altitude

_CUSTOM: Final = "rth.custom_location"
_NEAR_M: Final = 0.5  # within this distance of its goal the drone does not turn towards it
_STATUS: Final = {Outcome.DONE: "DONE", Outcome.INTERRUPTED: "CANCELED"}


def _bearing(state: WorldState, north_m: float, east_m: float) -> float:
    """Return the direction of a point, clockwise from north; the heading if it is near."""
    north, east = north_m - state.north_m, east_m - state.east_m
    return math.atan2(east, north) if math.hypot(north, east) > _NEAR_M else state.attitude.yaw_rad


def _on_earth(values: Values) -> bool:
    return bool(abs(values["latitude"]) <= 90.0 and abs(values["longitude"]) <= 180.0)


class MoveTo:
    """Handles moveTo and extended_move_to."""

    def __init__(self, flight: Flight) -> None:
        self._flight = flight
        self.handlers = {
            "ardrone3.Piloting.moveTo": self._move_to,
            "move.extended_move_to": self._extended_move_to,
        }
        self._asked: Mapping[str, Any] | None = None  # arguments of the present goal

    def _extended_move_to(self, values: Values, state: WorldState) -> None:
        # Whether it needs a climb or a turn is unknown here; only the drone knows its position.
        self._go(values, state, slowed(self._flight.pace, values, (True, False, False)))

    def _move_to(self, values: Values, state: WorldState) -> None:
        self._go(values, state, self._flight.pace)

    def _go(self, values: Values, state: WorldState, pace: Pace | None) -> None:
        numbers = {name: values[name] for name in ("latitude", "longitude", "altitude", "heading")}
        asked = numbers | {"orientation_mode": values["orientation_mode"].upper()}
        known = self._flight.world.outdoors and _on_earth(values)
        finite = math.isfinite(values["altitude"]) and math.isfinite(values["heading"])
        if state.flying not in AIRBORNE or not (known and finite) or pace is None:
            self._publish(asked, "ERROR")
            return
        self._asked = None  # a new goal replaces the old one without an event
        self._flight.interrupt()
        self._asked = asked
        self._publish(asked, "RUNNING")
        legs = self._legs(asked)
        self._flight.travel_on(legs, pace, partial(self._ended, asked), ignores_sticks=True)

    def _legs(self, asked: Mapping[str, Any]) -> list[Leg]:
        north_m, east_m = offset_m(asked["latitude"], asked["longitude"])
        altitude_m = min(asked["altitude"], self._flight.ceiling_m)
        mode, heading_rad = asked["orientation_mode"], math.radians(asked["heading"])

        def turn(state: WorldState) -> Step:
            yaw_rad = _bearing(state, north_m, east_m) if mode == "TO_TARGET" else heading_rad
            return Step(yaw_rad=wrap_angle(yaw_rad - state.attitude.yaw_rad))

        def cross(state: WorldState) -> Step:
            yaw_rad = heading_rad if mode == "HEADING_DURING" else state.attitude.yaw_rad
            return step_to(state, north_m, east_m, altitude_m, yaw_rad)

        return [turn, cross] if mode in ("TO_TARGET", "HEADING_START") else [cross]

    def _ended(self, asked: Mapping[str, Any], outcome: Outcome, _done: Step) -> None:
        if self._asked is asked:
            self._asked = None
            self._publish(asked, _STATUS.get(outcome, "ERROR"))

    def _publish(self, asked: Mapping[str, Any], status: str) -> None:
        event = "ardrone3.PilotingState.moveToChanged"
        self._flight.states.notify(event, **asked, status=status)


# From names of rth.state to names of ardrone3's NavigateHomeStateChanged.
_NAVIGATE_HOME: Final = {
    "in_progress": "inProgress",
    "user_request": "userRequest",
    "connection_lost": "connectionLost",
}


class ReturnHome:
    """Flies home on request, or after the link was lost for too long: climb, cross, land."""

    def __init__(self, flight: Flight) -> None:
        self._flight = flight
        self._returning = False
        self._flying = False
        self.link_lost_s: float | None = None  # time at which the last client was lost
        self._take_off_m = (0.0, 0.0)  # north, east
        self.handlers = {
            "rth.return_to_home": lambda _, state: self._start(state, "user_request"),
            "rth.abort": lambda _, __: self._stop(),
            "rth.set_custom_location": self._set_custom_location,
            "ardrone3.Piloting.NavigateHome": self._navigate_home,
        }
        self._publish_home()

    def update(self, state: WorldState) -> None:
        """Note the take-off point; return after the link was lost for the set delay."""
        flying = state.flying in (*AIRBORNE, FlyingState.TAKING_OFF)
        if flying and not self._flying:
            self._take_off_m = (state.north_m, state.east_m)
            self._publish_home()
            if self._flight.world.outdoors:
                self._publish("available", "enabled")
        elif not flying and self._flying and state.flying is not FlyingState.LANDING:
            self._publish("unavailable", "disabled")
        if state.flying is not FlyingState.LANDING:
            self._flying = flying
        delay_s = self._flight.states.value("rth.delay", "delay")
        if self.link_lost_s is not None and state.time_s - self.link_lost_s > delay_s:
            self.link_lost_s = None
            self._start(state, "connection_lost")

    def _start(self, state: WorldState, reason: str) -> None:
        if state.flying not in AIRBORNE or self._returning or not self._flight.world.outdoors:
            return
        self._flight.interrupt()
        self._returning = True
        self._publish("in_progress", reason)
        self._flight.travel_on(self._legs(), self._flight.pace, self._ended)

    def _legs(self) -> list[Leg]:
        value, ceiling_m = self._flight.states.value, self._flight.world.ceiling_m
        home_m = self._home_m

        def climb(state: WorldState) -> Step:
            near = math.dist(home_m, (state.north_m, state.east_m)) < _NEAR_M
            top_m = 0.0 if near else min(value("rth.min_altitude"), ceiling_m)
            return Step(down_m=min(0.0, state.altitude_m - top_m))

        def cross(state: WorldState) -> Step:
            return step_to(state, *home_m, state.altitude_m, _bearing(state, *home_m))

        def descend(state: WorldState) -> Step:
            hover_m = min(value("rth.ending_hovering_altitude"), ceiling_m)
            return Step(down_m=max(0.0, state.altitude_m - hover_m))

        return [climb, cross] if self._lands else [climb, cross, descend]

    @property
    def _home_m(self) -> tuple[float, float]:
        """The place to return to, m north and east: the client's, or that of the take-off."""
        custom = [self._flight.states.value(_CUSTOM, name) for name in ("latitude", "longitude")]
        return self._take_off_m if UNKNOWN in custom else offset_m(*custom)

    @property
    def _lands(self) -> bool:
        landing = self._flight.states.value("rth.ending_behavior", "ending_behavior") == "landing"
        return bool(landing)

    def _ended(self, outcome: Outcome, _done: Step) -> None:
        self._returning = False
        self._publish("available", "finished" if outcome is Outcome.DONE else "stopped")
        if outcome is Outcome.DONE and self._lands:
            self._flight.land()

    def _stop(self) -> None:
        if self._returning:
            self._flight.hover()

    def _navigate_home(self, values: Values, state: WorldState) -> None:
        if values["start"]:
            self._start(state, "user_request")
        else:
            self._stop()

    def _set_custom_location(self, values: Values, _state: WorldState) -> None:
        if _on_earth(values):
            self._flight.states.refresh(_CUSTOM, **values)
            self._publish_home()

    def _publish(self, state: str, reason: str) -> None:
        self._flight.states.set("rth.state", state=state, reason=reason)
        self._flight.states.set(
            "ardrone3.PilotingState.NavigateHomeStateChanged",
            state=_NAVIGATE_HOME.get(state, state),
            reason=_NAVIGATE_HOME.get(reason, reason),
        )

    def _publish_home(self) -> None:
        if not self._flight.world.outdoors:
            return
        publish = self._flight.states.set
        home = location(*self._home_m).arguments
        custom = self._flight.states.value(_CUSTOM, "latitude") != UNKNOWN
        publish("rth.home_type", type="custom" if custom else "takeoff")
        publish("rth.takeoff_location", **location(*self._take_off_m).arguments)
        publish("rth.home_location", **home)
        publish("ardrone3.GPSSettingsState.HomeChanged", **home)
        publish("rth.home_reachability", status="reachable")
