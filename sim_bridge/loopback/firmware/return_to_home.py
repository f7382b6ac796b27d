"""Return to home: the home position, the flight there, and the return after a lost link."""

from __future__ import annotations

import enum
import math
from typing import Final

from sim_bridge.loopback.firmware.core import Core, Outcome, Part, Step, step_to
from sim_bridge.loopback.firmware.piloting import AIRBORNE, Flight
from sim_bridge.loopback.firmware.publisher import Values
from sim_bridge.loopback.world import UNKNOWN, WorldState, location, offset_m
from uav_bt.types import FlyingState

_NEAR_M: Final = 0.5  # within this distance of home the drone lands without a climb
# From names of rth.state to names of ardrone3's NavigateHomeStateChanged.
_NAVIGATE_HOME: Final = {
    "in_progress": "inProgress",
    "user_request": "userRequest",
    "connection_lost": "connectionLost",
    "low_battery": "lowBattery",
}


class _Phase(enum.Enum):
    CLIMB = "climb"
    CROSS = "cross"
    DESCEND = "descend"


class ReturnToHome(Part):
    """Flies home on request, or after the link was lost for too long.

    Args:
        core: shared state of the parts.
        flight: lands the drone.
    """

    def __init__(self, core: Core, flight: Flight) -> None:
        super().__init__(core)
        self.handlers = {
            "rth.return_to_home": lambda _, state: self._start(state, "user_request"),
            "rth.abort": lambda _, state: self._stop(state),
            "rth.set_custom_location": self._set_custom_location,
            "rth.cancel_auto_trigger": self._cancel_auto_trigger,
            "ardrone3.Piloting.NavigateHome": self._navigate_home,
        }
        self._flight = flight
        self._phase: _Phase | None = None  # None: not returning
        self._flying = False
        self.link_lost_s: float | None = None  # time at which the last client was lost
        self._take_off_m: tuple[float, float] = (0.0, 0.0)  # north, east
        self._custom_m: tuple[float, float] | None = None
        self._publish("unavailable", "disabled")
        self._publish_home()

    def interrupted(self) -> None:
        """Abort the return, because another movement replaces it."""
        if self._phase is not None:
            self._phase = None
            self._publish("available", "stopped")

    def update(self, state: WorldState) -> None:
        """Record the take-off point; return after the link was lost for the set delay."""
        flying = state.flying in (*AIRBORNE, FlyingState.TAKING_OFF)
        if flying and not self._flying:
            self._take_off_m = (state.north_m, state.east_m)
            self._publish_home()
            if self._core.gps:
                self._publish("available", "enabled")
        elif not flying and self._flying and state.flying is not FlyingState.LANDING:
            self._phase = None
            self._publish("unavailable", "disabled")
        if state.flying is not FlyingState.LANDING:
            self._flying = flying
        lost_s, delay_s = self.link_lost_s, self._core.settings.value("rth.delay", "delay")
        if lost_s is not None and state.time_s - lost_s > delay_s:
            self.link_lost_s = None
            self._start(state, "connection_lost")

    def _start(self, state: WorldState, reason: str) -> None:
        if state.flying not in AIRBORNE or self._phase is not None or not self._core.gps:
            return
        self._core.interrupt()
        self._publish("in_progress", reason)
        self._enter(_Phase.CLIMB, state)

    def _stop(self, state: WorldState) -> None:
        if self._phase is not None:
            self._phase = None
            self._core.travel.interrupt(state, hover=True)
            self._publish("available", "stopped")

    def _enter(self, phase: _Phase, state: WorldState) -> None:
        self._phase = phase
        value, ceiling_m = self._core.settings.value, self._core.world.limits.ceiling_m
        home_m = self._custom_m or self._take_off_m
        away_m = math.hypot(home_m[0] - state.north_m, home_m[1] - state.east_m)
        goal_m, altitude_m = (state.north_m, state.east_m), state.altitude_m
        yaw_rad = state.attitude.yaw_rad
        if phase is _Phase.CLIMB:
            if away_m >= _NEAR_M:
                altitude_m = max(altitude_m, min(value("rth.min_altitude"), ceiling_m))
        elif phase is _Phase.CROSS:
            goal_m = home_m
            if away_m > _NEAR_M:
                yaw_rad = math.atan2(home_m[1] - state.east_m, home_m[0] - state.north_m)
        else:
            altitude_m = min(value("rth.ending_hovering_altitude"), ceiling_m, altitude_m)
        step = step_to(state, *goal_m, altitude_m, yaw_rad)
        self._core.travel.start(step, state, self._arrived, self._core.pace)

    def _arrived(self, outcome: Outcome, _done: Step, state: WorldState) -> None:
        if self._phase is None:
            return
        if outcome is not Outcome.DONE:
            self.interrupted()
        elif self._phase is _Phase.CLIMB:
            self._enter(_Phase.CROSS, state)
        elif self._phase is _Phase.DESCEND:
            self._finish()
        elif self._core.settings.value("rth.ending_behavior", "ending_behavior") == "landing":
            self._finish()
            self._flight.land()
        else:
            self._enter(_Phase.DESCEND, state)

    def _finish(self) -> None:
        self._phase = None
        self._publish("available", "finished")

    def _navigate_home(self, values: Values, state: WorldState) -> None:
        if values["start"]:
            self._start(state, "user_request")
        else:
            self._stop(state)

    def _set_custom_location(self, values: Values, _state: WorldState) -> None:
        if math.isfinite(values["latitude"]) and math.isfinite(values["longitude"]):
            self._custom_m = offset_m(values["latitude"], values["longitude"])
            self._core.publisher.refresh("rth.custom_location", **values)
            self._publish_home()

    def _cancel_auto_trigger(self, _values: Values, _state: WorldState) -> None:
        self._core.publisher.refresh("rth.rth_auto_trigger", reason="none", delay=0)

    def _publish(self, state: str, reason: str) -> None:
        self._core.publisher.state("rth.state", state=state, reason=reason)
        self._core.publisher.state(
            "ardrone3.PilotingState.NavigateHomeStateChanged",
            state=_NAVIGATE_HOME.get(state, state),
            reason=_NAVIGATE_HOME.get(reason, reason),
        )

    def _publish_home(self) -> None:
        publish = self._core.publisher.state
        take_off = location(*self._take_off_m).arguments
        if not self._core.gps:
            take_off = dict.fromkeys(take_off, UNKNOWN)
        home = take_off if self._custom_m is None else location(*self._custom_m).arguments
        publish("rth.home_type", type="custom" if self._custom_m else "takeoff")
        publish("rth.takeoff_location", **take_off, fixed_before_takeoff=1)
        publish("rth.home_location", **home)
        publish("ardrone3.GPSSettingsState.HomeChanged", **home)
        if self._custom_m is None:
            publish("rth.custom_location", **dict.fromkeys(home, UNKNOWN))
        reachable = "reachable" if self._core.gps else "unknown"
        publish("rth.home_reachability", status=reachable)
