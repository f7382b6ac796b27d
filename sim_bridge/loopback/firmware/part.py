"""What the firmware is made of."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Protocol

from sim_bridge.loopback.world import WorldState

__all__ = ["Handler", "Part", "Values"]

Values = Mapping[str, Any]
Handler = Callable[[Values, WorldState], None]


class Part(Protocol):
    """One part of the firmware."""

    def handlers(self) -> Mapping[str, Handler]:
        """Return what obeys which command, by the command's name."""
        ...

    def update(self, state: WorldState) -> None:
        """Take notice of a new state and tell what it means; `state.time_s` is the time."""
        ...
