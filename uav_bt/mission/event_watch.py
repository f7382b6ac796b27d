"""Events that no leaf reports: phases, failed branches, overrides, take-overs, the landing."""

from __future__ import annotations

from uav_bt.board import PHASE
from uav_bt.board.context import MissionContext
from uav_bt.mission.safety import Override
from uav_bt.tree.node import Node
from uav_bt.tree.watches import BranchEnds
from uav_bt.types.flight_results import EventKind


class EventWatch:
    """Compares each tick with the last one, and adds the changes to a flight's notes."""

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
        add = self._context.add_event
        for node in ends.failed:
            self.failure = _words(node)
            add(EventKind.FAILED, self.failure, node.path)
        phase = self._context.board.read(PHASE).value or ""
        if phase != self.phase:
            self.phase = phase
            add(EventKind.PHASE, phase, self._context.proposals.movement_owner or "")
        self._note_override(override, refused)
        if landed and self._flew:
            add(EventKind.LANDED, "the drone landed")
        self._flew = not landed
        if ends.ended is not None:
            how = "succeeded" if ends.succeeded else "failed"
            if ends.ended.feedback_message and not ends.succeeded:
                self.failure = _words(ends.ended)
            add(EventKind.ENDED, f"the tree {how} at {_words(ends.ended)}", ends.ended.path)

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
    """Return a node's name, with its reason if it gave one."""
    return f"{node.name}: {node.feedback_message}" if node.feedback_message else node.name
