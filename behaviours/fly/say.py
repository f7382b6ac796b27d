"""A leaf that adds a message to the flight's events."""

from __future__ import annotations

from uav_bt.tree import Leaf, Port, Status
from uav_bt.tree.script.parser import fill_text, parse_text
from uav_bt.types.flight_results import EventKind


class Say(Leaf):
    """Add a message to the flight's events; SUCCESS always."""

    answers = (Status.SUCCESS,)
    ports = (
        Port(
            "text",
            str,
            check=parse_text,
            doc="one line; {variable} and {@board_key} are replaced by their values",
        ),
        Port(
            "level",
            str,
            default=EventKind.INFO.value,
            choices=(EventKind.INFO.value, EventKind.WARNING.value),
            doc="kind of the event: info or warning",
        ),
    )

    def update(self) -> Status:
        """Add the message; a name without a value becomes "unknown"."""
        text = fill_text(self.port_value("text"), self.environment)
        self.feedback_message = text
        self.mission.add_event(EventKind(self.port_value("level")), text, self.path)
        return Status.SUCCESS
