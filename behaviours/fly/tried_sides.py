"""On which side of what stands before the helipad the way was tried.

A policy that judges single views turns away to whichever side looks better from where the drone is,
and a step later that may be the other one: it goes to and fro before the obstacle. A detour
therefore keeps its side until that side has failed often enough.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from uav_bt.types import HeldTurn


@dataclass(frozen=True, kw_only=True)
class TriedSidesConfig:
    """When a side has failed, and when an obstacle is another one."""

    tries: int = 4  # detours in vain to one side before the other one is tried
    nearer_m: float = 0.5  # stopped so much nearer to the pad, it is before another obstacle
    relieved_after: int = 2  # detours in vain; then the policy is asked as after a full turn


class TriedSides:
    """Remembers the side of the detours round one obstacle, and how many were in vain."""

    def __init__(self, config: TriedSidesConfig | None = None) -> None:
        self._config = config or TriedSidesConfig()
        self.forget()

    def forget(self) -> None:
        """Forget the obstacle."""
        self._side = 0  # +1 clockwise, -1 counter-clockwise, 0 none yet
        self._stopped_m = math.inf  # from the pad, when the obstacle was first met
        self._in_vain = 0

    def stopped(self, range_m: float, side: int) -> None:
        """Note that something stands before the pad: choose the side of the next detour.

        Args:
            range_m: from the drone to the pad.
            side: that the policy would turn to, +1 clockwise, -1 counter-clockwise.
        """
        if self._side == 0 or range_m <= self._stopped_m - self._config.nearer_m:
            self._side, self._stopped_m, self._in_vain = side, range_m, 0
            return
        self._in_vain += 1
        if self._in_vain % self._config.tries == 0:
            self._side = -self._side

    def leaving(self) -> HeldTurn:
        """Return the turn that the detour begins with."""
        return HeldTurn(direction=self._side, relief_turns=self._relief_turns)

    def facing(self) -> HeldTurn:
        """Return what is held while the pad is faced: no direction, but the relief."""
        return HeldTurn(relief_turns=self._relief_turns)

    @property
    def _relief_turns(self) -> int:
        return 1 if self._in_vain >= self._config.relieved_after else 0
