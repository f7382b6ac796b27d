"""Lines of text for the commands of a rehearsal."""

from __future__ import annotations

from collections.abc import Callable

from uav_bt.display.phrases import describe_movement
from uav_bt.mission.tick import TickRecord
from uav_bt.types import MoveBy, Velocity


class OrderLines:
    """A tick listener that writes a line for each new command.

    Args:
        write: called with each line.
    """

    def __init__(self, write: Callable[[str], None]) -> None:
        self._write = write
        self._last: object = None

    def on_tick(self, record: TickRecord) -> None:
        """Write the command of the tick if it is new; changed speeds are not new."""
        movement = record.command.movement
        order: object = type(movement)
        if isinstance(movement, MoveBy):
            order = movement.id
        if order != self._last:
            self._last = order
            more = ", then at changing speeds" if isinstance(movement, Velocity) else ""
            self._write(
                f"{record.time_s:6.1f} s  would be sent: {describe_movement(movement)}{more}"
            )
