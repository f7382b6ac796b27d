"""Which `MoveBy` an end event belongs to: the drone's events carry no id, only distances.

The firmware ends every relative movement with one event, and a second command ends the first one
with "interrupted" (ARSDK, ardrone3.PilotingEvent.moveByEnd). Commands and events cross on the way,
so those told and not yet ended are kept in order.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from typing import Final

from uav_bt.types import MoveBy, MovementState, MovementStatus

__all__ = ["Displacement", "MoveLedger"]

Displacement = tuple[float, float, float, float]  # forward, right, down in metres; yaw in radians

_REFUSALS: Final = frozenset({"busy", "notAvailable", "unknown"})


@dataclass(frozen=True, kw_only=True)
class _Told:
    id: int | None  # None for the halt that replaces a movement nobody wants any more
    wanted: Displacement


class MoveLedger:
    """Keeps the movements that the drone was told until it says how they ended."""

    def __init__(self) -> None:
        self._open: deque[_Told] = deque()
        self._status: MovementStatus | None = None

    @property
    def status(self) -> MovementStatus | None:
        """The drone's word on the latest `MoveBy`."""
        return self._status

    @property
    def moving(self) -> bool:
        """Whether the latest `MoveBy` is still under way and wanted."""
        return bool(self._open) and self._open[-1].id is not None

    def is_latest(self, move: MoveBy) -> bool:
        """Return whether a movement was told before."""
        return self._status is not None and self._status.id == move.id

    def told(self, move: MoveBy) -> None:
        """Note a movement that goes to the drone."""
        wanted = (move.forward_m, move.right_m, move.down_m, move.yaw_rad)
        self._open.append(_Told(id=move.id, wanted=wanted))
        self._status = MovementStatus(id=move.id, state=MovementState.RUNNING)

    def halted(self) -> None:
        """Note that a movement by nothing at all goes to the drone, which ends the one before."""
        self._open.append(_Told(id=None, wanted=(0.0, 0.0, 0.0, 0.0)))

    def ended(self, error: str, flown: Displacement) -> None:
        """Take the drone's event.

        Args:
            error: the name it gives: ok, interrupted, busy, notAvailable or unknown.
            flown: what it says to have flown.
        """
        if not self._open:
            return
        if error in _REFUSALS:
            self._close(self._open.pop(), MovementState.REJECTED)
        elif error == "interrupted":
            self._close(self._open.popleft(), MovementState.INTERRUPTED)
        else:
            # A later command or an earlier event may have been lost: distances tell which it is.
            done = min(self._open, key=lambda told: math.dist(told.wanted, flown))
            while self._open[0] is not done:
                self._close(self._open.popleft(), MovementState.INTERRUPTED)
            self._close(self._open.popleft(), MovementState.DONE)

    def drop(self, state: MovementState = MovementState.INTERRUPTED) -> None:
        """Forget what is open: the drone landed, or will not tell any more."""
        while self._open:
            self._close(self._open.popleft(), state)

    def _close(self, told: _Told, state: MovementState) -> None:
        if told.id is not None and self._status is not None and self._status.id == told.id:
            self._status = MovementStatus(id=told.id, state=state)
