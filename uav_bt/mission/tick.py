"""The record of one tick, its events, and the listeners of a flight."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from uav_bt.board import PHASE
from uav_bt.board.context import MissionContext
from uav_bt.mission.safety import Override
from uav_bt.tree import Status
from uav_bt.tree.node import Node
from uav_bt.tree.nodes.base import DecoratorNode
from uav_bt.tree.watches import BranchEnds, SlowLeaf
from uav_bt.types import Command, Observation, Truth
from uav_bt.types.flight_results import EventKind, FlightEvent


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


class EventWatch:
    """Adds the events that no leaf reports to a flight's notes: a tick differs from the last one.

    They are phases, failed branches, overrides, take-overs and the landing.
    """

    def __init__(self, context: MissionContext) -> None:
        self._context = context
        self.phase = ""  # the mission's: board key `phase`; empty before the first one
        self._override: Override | None = None
        self._flew = False
        self.failure = ""  # the last branch that failed, or the tree's own reason

    def update(
        self, override: Override | None, refused: tuple[str, ...], ends: BranchEnds, *, landed: bool
    ) -> None:
        """Add the events of a tick; `refused` says why frame or telemetry were refused in it."""
        add, told = self._context.add_event, self._context.notes.told()
        for node in (*ends.failed, *ends.expected):
            self.failure = told.get(node.path, _words(node))
            if node.path not in told:
                kind = EventKind.FAILED if node in ends.failed else EventKind.EXPECTED
                add(kind, self.failure, node.path)
        phase = self._context.board.read(PHASE).value or ""
        if phase != self.phase:
            self.phase = phase
            add(EventKind.PHASE, phase, self._context.proposals.movement_owner or "")
        self._note_override(override, refused)
        if landed and self._flew:
            add(EventKind.LANDED, "the drone landed")
        self._flew = not landed
        if ends.ended is not None:
            how, path = "succeeded" if ends.succeeded else "failed", ends.ended.path
            if ends.ended.feedback_message and not ends.succeeded:
                self.failure = told.get(path, _words(ends.ended))
            where = ends.ended.name if path in told else _words(ends.ended)
            add(EventKind.ENDED, f"the tree {how} at {where}", path)

    def _note_override(self, override: Override | None, reasons: tuple[str, ...]) -> None:
        before, self._override = self._override, override
        if override is before:
            return
        add = self._context.add_event
        if before is Override.MANUAL:
            add(EventKind.PILOT_OVER, "the mission goes on")
        elif before is not None:
            add(EventKind.OVERRIDE_OVER, before.value)
        if override is Override.MANUAL:
            add(EventKind.PILOT, "a person took over")
        elif override is not None:
            why = f": {reasons[0]}" if reasons else ""
            add(EventKind.OVERRIDE, f"{override.value}{why}")


def _words(node: Node) -> str:
    """Return a node's name, with its reason if it gave one; of what, for an unnamed decorator."""
    name, below = node.name, node
    while below.name == below.node_id and isinstance(below, DecoratorNode):
        below = below.child
        name = f"{node.name} of {below.name}"
    return f"{name}: {node.feedback_message}" if node.feedback_message else name
