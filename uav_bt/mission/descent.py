"""Brings the drone down after its mission; no fault ends the attempt early."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, Protocol, runtime_checkable

from uav_bt.protocols import Drone
from uav_bt.types import Command, DroneState, FlyingState

_DOWN = frozenset({FlyingState.LANDED, FlyingState.EMERGENCY})  # motors off, intended or not


@runtime_checkable
class DescentListener(Protocol):
    """A tick listener that also follows the landing after the last tick."""

    def on_descent(self, state: DroneState | None, reason: str) -> None:
        """Called after each landing command; must not block. The state is None before the first."""
        ...


class Descent:
    """Commands a landing until the drone is down or lost, a pilot has it, or `grace_s` is over.

    Each method of the drone may raise. `command_for` returns the command for the newest state.
    """

    def __init__(
        self,
        drone: Drone,
        command_for: Callable[[DroneState | None], Command],
        *,
        grace_s: float,
        tick_s: float,
    ) -> None:
        self._drone = drone
        self._command_for = command_for
        self._grace_s = grace_s
        self._tick_s = tick_s
        self.airborne = False  # at its end, as far as is known
        self.faults: dict[str, None] = {}  # errors in it, each once

    def run(self, reason: str, listeners: Sequence[object], given_up: Callable[[], bool]) -> None:
        """Bring the drone down; a landing that was given up is commanded once, and not waited for.

        Each `DescentListener` among the listeners is called after each command.
        """
        state: DroneState | None = None
        clock = self._drone.clock
        start_s = clock.now()
        # The count ends the loop if the clock stands still.
        for _ in range(math.ceil(self._grace_s / self._tick_s) + 1):
            now_s = clock.now()
            seen = self._attempt(self._drone.observe)
            state = state if seen is None else seen.state
            if state is not None and (self._is_down(state) or state.pilot_has_control):
                break
            if now_s >= start_s + self._grace_s:
                break
            self._attempt(self._send, state)
            for listener in listeners:
                if isinstance(listener, DescentListener):
                    self._attempt(listener.on_descent, state, reason)
            if given_up() or (state is not None and state.lost):
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
