"""Ledger of movements: assigns the drone's end events to `MoveBy` commands.

The events carry no id, only distances. The firmware ends every relative movement with one event,
and a second command ends the first one with "interrupted" (ARSDK,
ardrone3.PilotingEvent.moveByEnd). Commands and events cross in transit, so the open movements are
kept in order.
"""

from __future__ import annotations

import math
import threading
from collections import deque
from dataclasses import dataclass
from typing import Final

from uav_bt.types import MoveBy, MovementState, MovementStatus

Displacement = tuple[float, float, float, float]  # forward, right, down in metres; yaw in radians

_REFUSALS: Final = frozenset({"busy", "notAvailable", "unknown"})


@dataclass(frozen=True)
class _Entry:
    """An open movement: sent, but not ended."""

    id: int | None  # None: a halt that replaces a movement
    wanted: Displacement


class MoveLedger:
    """Stores the movements that were sent until the drone reports their end.

    Commands come from the thread of the mission, events from one of the SDK.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._open: deque[_Entry] = deque()
        self.status: MovementStatus | None = None  # status of the latest `MoveBy`

    def begin(self, move: MoveBy) -> bool:
        """Record a movement that is sent; return False if it was sent already."""
        with self._lock:
            if self.status is not None and self.status.id == move.id:
                return False
            wanted = (move.forward_m, move.right_m, move.down_m, move.yaw_rad)
            self._open.append(_Entry(move.id, wanted))
            self.status = MovementStatus(id=move.id, state=MovementState.RUNNING)
            return True

    def halt(self) -> bool:
        """Record a movement by zero, which ends the latest one; return False if none is running."""
        with self._lock:
            if not self._open or self._open[-1].id is None:
                return False
            self._open.append(_Entry(None, (0.0, 0.0, 0.0, 0.0)))
            return True

    def ended(self, error: str, flown: Displacement) -> None:
        """Handle the drone's end event: ok, interrupted, busy, notAvailable or unknown."""
        with self._lock:
            if not self._open:
                return
            if error in _REFUSALS:
                self._close(self._open.pop(), MovementState.REJECTED)
            elif error == "interrupted":
                self._close(self._open.popleft(), MovementState.INTERRUPTED)
            else:
                # A command or an event may have been lost, so the nearest displacement is selected.
                done = min(self._open, key=lambda entry: math.dist(entry.wanted, flown))
                while self._open[0] is not done:
                    self._close(self._open.popleft(), MovementState.INTERRUPTED)
                self._close(self._open.popleft(), MovementState.DONE)

    def drop(self) -> None:
        """Close all open movements as interrupted, after a landing."""
        with self._lock:
            while self._open:
                self._close(self._open.popleft(), MovementState.INTERRUPTED)

    def _close(self, entry: _Entry, state: MovementState) -> None:
        if entry.id is not None and self.status is not None and self.status.id == entry.id:
            self.status = MovementStatus(id=entry.id, state=state)
