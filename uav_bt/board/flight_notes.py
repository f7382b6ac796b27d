"""Events and photographs of a flight, in the order in which they happened."""

from __future__ import annotations

from typing import Final

from uav_bt.types.flight_results import EventKind, FlightEvent, Photo

_MAX_EVENTS: Final = 2000  # a leaf in a loop may report in every tick; chosen


class FlightNotes:
    """Collects the events and photographs of one flight."""

    def __init__(self) -> None:
        self.events: list[FlightEvent] = []  # the first 2000, and one that says so
        self.photos: list[Photo] = []
        self._taken = 0
        self._photo = 0

    def add(self, event: FlightEvent) -> None:
        """Add an event."""
        if len(self.events) < _MAX_EVENTS:
            self.events.append(event)
        elif len(self.events) == _MAX_EVENTS:
            text = f"the flight has more than {_MAX_EVENTS} events: further ones are not kept"
            self.events.append(FlightEvent(time_s=event.time_s, kind=EventKind.WARNING, text=text))

    def next_photo(self) -> int:
        """Return the number of the next photograph, from 1. A failed one keeps its number."""
        self._photo += 1
        return self._photo

    def take(self) -> tuple[FlightEvent, ...]:
        """Return the events since the last call."""
        new = tuple(self.events[self._taken :])
        self._taken = len(self.events)
        return new
