"""Flights to a place on earth: moveTo, and the return home. They need a GPS fix."""

from __future__ import annotations

import math
from typing import Any, Final

from sim_bridge.loopback.codec import Values
from sim_bridge.loopback.firmware.flight import AIRBORNE, Flight
from sim_bridge.loopback.firmware.moves import slowed
from sim_bridge.loopback.firmware.travel import Leg, Outcome, Step, step_to
from sim_bridge.loopback.world import WorldState, location, offset_m
from sim_bridge.twin.reference import Pace
from uav_bt.types import FlyingState, wrap_angle

_UNKNOWN: Final = 500.0  # ARSDK's value of an unknown latitude, longitude or altitude
_NEAR_M: Final = 0.5  # within this distance of its goal the drone does not turn towards it


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
        self._asked: Values = {}  # arguments of the last goal
        self.handlers = {
            "ardrone3.Piloting.moveTo": self._move_to,
            "move.extended_move_to": self._move_to,
        }

    def _move_to(self, values: Values, state: WorldState) -> None:
        pace: Pace | None = self._flight.pace
        if "max_horizontal_speed" in values:
            # Whether it needs a climb or a turn is unknown here; only the drone knows its position.
            pace = slowed(self._flight.pace, values, (True, False, False))
        names = ("latitude", "longitude", "altitude", "orientation_mode", "heading")
        asked = {name: values[name] for name in names}
        asked["orientation_mode"] = asked["orientation_mode"].upper()
        finite = math.isfinite(asked["altitude"]) and math.isfinite(asked["heading"])
        known = self._flight.world.outdoors and _on_earth(asked) and finite
        if state.flying not in AIRBORNE or not known or pace is None:
            self._publish(asked, "ERROR")
            return

        def ended(outcome: Outcome, _done: Step) -> None:
            if self._asked is asked:  # a new goal replaces the old one without an event
                statuses = {Outcome.DONE: "DONE", Outcome.INTERRUPTED: "CANCELED"}
                self._publish(asked, statuses.get(outcome, "ERROR"))

        self._asked = asked
        self._flight.interrupt()
        self._publish(asked, "RUNNING")
        self._flight.travel_on(self._legs(asked), pace, ended, ignores_sticks=True)

    def _legs(self, asked: Values) -> list[Leg]:
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

    def _publish(self, asked: Values, status: str) -> None:
        event = "ardrone3.PilotingState.moveToChanged"
        self._flight.states.notify(event, **asked, status=status)


_CUSTOM: Final = "rth.custom_location"
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
        self._value = flight.states.value
        self._take_off_m = (0.0, 0.0)  # north, east
        self._flying = False
        self.link_lost_s: float | None = None  # time at which the last client was lost
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
        delay_s = self._value("rth.delay", "delay")
        if self.link_lost_s is not None and state.captured_s - self.link_lost_s > delay_s:
            self.link_lost_s = None
            self._start(state, "connection_lost")

    @property
    def _returning(self) -> bool:
        return bool(self._value("rth.state", "state") == "in_progress")

    @property
    def _home_m(self) -> tuple[float, float]:
        """The place to return to, m north and east: the client's, or that of the take-off."""
        custom = [self._value(_CUSTOM, name) for name in ("latitude", "longitude")]
        return self._take_off_m if _UNKNOWN in custom else offset_m(*custom)

    def _start(self, state: WorldState, reason: str) -> None:
        if state.flying in AIRBORNE and not self._returning and self._flight.world.outdoors:
            self._flight.interrupt()
            self._publish("in_progress", reason)
            lands = self._value("rth.ending_behavior", "ending_behavior") == "landing"
            self._fly(lands=lands)

    def _fly(self, *, lands: bool) -> None:
        ceiling_m, home_m = self._flight.world.ceiling_m, self._home_m
        top_m = min(self._value("rth.min_altitude"), ceiling_m)
        hover_m = min(self._value("rth.ending_hovering_altitude"), ceiling_m)

        def climb(state: WorldState) -> Step:
            near = math.dist(home_m, (state.north_m, state.east_m)) < _NEAR_M
            return Step(down_m=0.0 if near else min(0.0, state.altitude_m - top_m))

        def cross(state: WorldState) -> Step:
            return step_to(state, *home_m, state.altitude_m, _bearing(state, *home_m))

        def descend(state: WorldState) -> Step:
            return Step(down_m=max(0.0, state.altitude_m - hover_m))

        def ended(outcome: Outcome, _done: Step) -> None:
            self._publish("available", "finished" if outcome is Outcome.DONE else "stopped")
            if outcome is Outcome.DONE and lands:
                self._flight.land()

        legs = [climb, cross] if lands else [climb, cross, descend]
        self._flight.travel_on(legs, self._flight.pace, ended)

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
        legacy = [_NAVIGATE_HOME.get(name, name) for name in (state, reason)]
        event = "ardrone3.PilotingState.NavigateHomeStateChanged"
        self._flight.states.set("rth.state", state=state, reason=reason)
        self._flight.states.set(event, state=legacy[0], reason=legacy[1])

    def _publish_home(self) -> None:
        if self._flight.world.outdoors:
            publish = self._flight.states.set
            home: dict[str, Any] = location(*self._home_m).arguments
            custom = self._value(_CUSTOM, "latitude") != _UNKNOWN
            publish("rth.home_type", type="custom" if custom else "takeoff")
            publish("rth.takeoff_location", **location(*self._take_off_m).arguments)
            publish("rth.home_location", **home)
            publish("ardrone3.GPSSettingsState.HomeChanged", **home)
            publish("rth.home_reachability", status="reachable")
