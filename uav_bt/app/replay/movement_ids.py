"""Which movement of the replay stands for which of the recording.

The drone answers by a movement's number, and numbers are counted as movements are made. Once a
replay makes one more or one less, all that follow are shifted; the answers must still arrive.
"""

from __future__ import annotations

from dataclasses import replace

from uav_bt.types import DroneState, MoveBy, Movement


class MovementIds:
    """Pairs movements that were commanded at the same time."""

    def __init__(self) -> None:
        self._replayed: dict[int, int] = {}  # by the recording's id

    def pair(self, recorded: Movement, replayed: Movement) -> bool:
        """Note what was commanded in one tick; return whether it is the same movement.

        Two that began together are the same, whatever they do; movements without numbers are.
        """
        if not isinstance(recorded, MoveBy) or not isinstance(replayed, MoveBy):
            return True
        known = self._replayed.get(recorded.id)
        if known is None and replayed.id not in self._replayed.values():
            self._replayed[recorded.id] = replayed.id
            return True
        return known == replayed.id

    def told(self, state: DroneState) -> DroneState:
        """Return a recorded state as the replay's leaves must read it."""
        movement = state.movement
        if movement is None:
            return state
        # Ids count from 1 up: nobody waits for a negative one.
        replayed = self._replayed.get(movement.id, -abs(movement.id))
        if replayed == movement.id:
            return state
        return replace(state, movement=replace(movement, id=replayed))
