"""The early end of a mission, and the landing after its end.

Reasons to end it early are lasting conditions, an operator's stop, a tree that ends in the air.

The safety table (`safety.py`) answers within the tick. A lasting condition is answered here, by an
abort, which is a landing, or by an error if the drone is out of reach.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, Final, Protocol, runtime_checkable

from uav_bt.board.keys import STATE
from uav_bt.errors import DroneError
from uav_bt.mission.judge import Outcome, Verdict
from uav_bt.mission.limits import Limits
from uav_bt.mission.map_check import MapWatch
from uav_bt.mission.obedience import ObedienceWatch
from uav_bt.mission.safety import AIRBORNE, Lasting, Override
from uav_bt.mission.screening import Screening
from uav_bt.mission.tick import TickRecord
from uav_bt.protocols import Drone
from uav_bt.types import Command, DroneState, FlyingState
from uav_bt.types.site_map import SiteMap

_OUT_OF_REACH: Final = (
    "it hovers, lands or returns by its own rules; take over with its remote control"
)


class Abort:
    """The one place for every reason to end a mission early, and the wait for the landing.

    Every method except `follow` may be called from a signal handler or another thread. The landing
    is waited for by `grace_s`.
    """

    def __init__(self, grace_s: float) -> None:
        self.grace_s = grace_s
        self._landing = Lasting()
        self.reason: str | None = None  # None: not aborted
        self.cut = False  # stop the motors
        self.given_up = False  # do not wait for the landing

    def __bool__(self) -> bool:
        """Return whether the mission is being aborted."""
        return self.reason is not None

    def request(self, reason: str) -> None:
        """Request a landing with the next tick; the first reason counts."""
        if self.reason is None:
            self.reason = reason

    def cut_motors(self, reason: str) -> None:
        """Stop the motors with the next tick."""
        self.cut = True
        self.request(reason)

    def give_up(self) -> None:
        """Command one last landing and return."""
        self.given_up = True

    def follow(self, record: TickRecord) -> Verdict | None:
        """Return the verdict of an aborted mission, None while it waits for the landing."""
        lands = record.override is Override.ABORT
        if self._landing.update(record.time_s, holds=lands) > self.grace_s:
            self.given_up = True
        if self.reason is None or not self.given_up:
            return None
        return Verdict(Outcome.ABORTED, self.reason)


class Contingencies:
    """Watches one mission for conditions that must end it."""

    def __init__(self, limits: Limits) -> None:
        self._limits = limits
        self._obedience = ObedienceWatch()
        self.map = MapWatch()
        self._blind, self._refused, self._unheard = (Lasting() for _ in range(3))

    def abort_reason(
        self, record: TickRecord, screening: Screening, drift: str | None, site_map: SiteMap | None
    ) -> str | None:
        """Return the reason to abort the mission with a landing; None without one.

        `drift` says why the place cannot be held, None while it can.

        Raises:
            DroneError: the connection is lost, or no telemetry has come for too long.
        """
        now_s, state, override = record.time_s, record.observation.state, record.override
        self.map.update(site_map, now_s, airborne=state.flying in AIRBORNE)
        if state.lost:
            raise DroneError(f"the connection to the drone is broken: {_OUT_OF_REACH}")
        fault = self._obedience.complaint(record.command, state, now_s) or drift
        # The override holds for one tick; the abort holds until the drone has landed.
        if override is Override.BATTERY:
            return f"critical battery: {100 * (state.battery or 0.0):.0f} %"
        if fault is not None and override is not Override.MANUAL:
            return f"the drone does not obey: {fault}"
        if self.map.trouble is not None and override is None:
            return self.map.trouble
        return self._out_of_touch(now_s, override, screening, now_s - state.captured_s)

    def _out_of_touch(
        self, now_s: float, override: Override | None, screening: Screening, state_age_s: float
    ) -> str | None:
        limits = self._limits
        blind_s = self._blind.update(now_s, holds=override is Override.STALE_FRAME)
        # A few impossible values among good ones, or before them, do not count.
        refused = screening.state_fault is not None and state_age_s > STATE.max_age_s
        refused_s = self._refused.update(now_s, holds=refused)
        unheard_s = self._unheard.update(now_s, holds=override is Override.LINK)
        if unheard_s > limits.link_lost_s and screening.state_fault is None:
            raise DroneError(f"nothing heard from the drone for {unheard_s:.0f} s: {_OUT_OF_REACH}")
        if blind_s > limits.blind_s:
            why = f": {screening.frame_fault}" if screening.frame_fault else ""
            return f"no usable frame for {blind_s:.0f} s{why}"
        if refused_s > limits.link_lost_s:  # telemetry arrives with impossible values
            return f"no usable telemetry for {refused_s:.0f} s: {screening.state_fault}"
        return None


# --- the landing ----------------------------------------------------------------------------------

_DOWN: Final = {FlyingState.LANDED, FlyingState.EMERGENCY}  # motors off, intended or not


@runtime_checkable
class DescentListener(Protocol):
    """A tick listener that also follows the landing after the last tick."""

    def on_descent(self, state: DroneState | None, reason: str) -> None:
        """Called after each landing command; must not block. The state is None before the first."""
        ...


class Descent:
    """Commands a landing until the drone is down or lost, a pilot has it, or the grace is over.

    Each method of the drone may raise. `command_for` returns the command for the newest state.
    """

    def __init__(
        self,
        drone: Drone,
        command_for: Callable[[DroneState | None], Command],
        abort: Abort,
        tick_s: float,
    ) -> None:
        self._drone = drone
        self._command_for = command_for
        self._abort = abort
        self._tick_s = tick_s
        self.airborne = False  # at its end, as far as is known
        self.faults: dict[str, None] = {}  # errors in it, each once

    def run(self, reason: str, listeners: Sequence[object]) -> None:
        """Bring the drone down; a landing that was given up is commanded once, and not waited for.

        Each `DescentListener` among the listeners is called after each command.
        """
        state: DroneState | None = None
        clock, grace_s = self._drone.clock, self._abort.grace_s
        start_s = clock.now()
        # The count ends the loop if the clock stands still.
        for _ in range(math.ceil(grace_s / self._tick_s) + 1):
            now_s = clock.now()
            seen = self._attempt(self._drone.observe)
            state = state if seen is None else seen.state
            if state is not None and (self._is_down(state) or state.pilot_has_control):
                break
            if now_s >= start_s + grace_s:
                break
            self._attempt(self._send, state)
            for listener in listeners:
                if isinstance(listener, DescentListener):
                    self._attempt(listener.on_descent, state, reason)
            if self._abort.given_up or (state is not None and state.lost):
                break  # nobody waits for the landing, or the drone cannot be reached
            self._attempt(clock.sleep_until, now_s + self._tick_s)
        self.airborne = state is None or not self._is_down(state)

    def _send(self, state: DroneState | None) -> None:
        self._drone.send(self._command_for(state))

    def _attempt(self, action: Callable[..., Any], *given: Any) -> Any:
        """Return what an action returns, None when it raises."""
        try:
            return action(*given)
        except Exception as fault:  # noqa: BLE001  # whatever it is, the drone must come down
            self.faults[f"{type(fault).__name__}: {fault}"] = None
            return None

    def _is_down(self, state: DroneState) -> bool:
        if state.flying not in _DOWN:
            return False
        truth = self._attempt(self._drone.referee.truth) if self._drone.referee else None
        return truth is None or not truth.motors_on
