"""The record of one tick, and the listeners of a flight."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from uav_bt.mission.safety import Override
from uav_bt.tree import Status
from uav_bt.tree.watches import SlowLeaf
from uav_bt.types import Command, Observation, Truth
from uav_bt.types.flight_results import FlightEvent


@dataclass(frozen=True, kw_only=True)
class TickRecord:
    """Everything that happened in one tick: the input of records, reports, displays and videos."""

    index: int
    time_s: float
    observation: Observation  # screened
    tree_status: Status
    phase: str  # of the mission: board key `phase`; empty before the first one
    active: tuple[str, ...]  # names from the root to the deepest running node
    command: Command  # as the drone sent it
    proposed_by: str | None
    override: Override | None
    compute_s: float  # wall time of tree, networks included
    truth: Truth | None
    feedback: str = ""  # of the deepest running node, such as a policy's reason
    slow: tuple[SlowLeaf, ...] = ()  # leaves that blocked, a halt since the last tick included
    refused: tuple[str, ...] = ()  # frame or telemetry, and why it was refused
    decided: Command | None = None  # by the arbiter, before the drone's limits
    # Faults of the drone's motion or of the map that do not end the mission.
    warnings: tuple[str, ...] = ()
    events: tuple[FlightEvent, ...] = ()  # of this tick


class TickListener(Protocol):
    """Follows a flight tick by tick."""

    def on_tick(self, record: TickRecord) -> None:
        """Called after each tick; must not block."""
        ...


class TickListeners:
    """The listeners of one flight. A listener that raises is not called again.

    So a failed display or a full disk does not end a flight.
    """

    def __init__(self, listeners: Sequence[TickListener]) -> None:
        self.following = list(listeners)
        self.lost: dict[str, str] = {}  # by kind of listener, the second with #2: its error

    def on_tick(self, record: TickRecord) -> None:
        """Call all listeners that have not failed."""
        for listener in tuple(self.following):
            try:
                listener.on_tick(record)
            except Exception as fault:  # noqa: BLE001  # whatever a listener does wrong
                self.following.remove(listener)
                name = type(listener).__name__
                alike = sum(known.partition("#")[0] == name for known in self.lost)
                key = f"{name}#{alike + 1}" if alike else name
                self.lost[key] = f"{type(fault).__name__}: {fault}"
