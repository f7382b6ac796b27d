"""A leaf's own time, which stands still while the tree is not ticked."""

from __future__ import annotations

import math
from typing import Final

from uav_bt.protocols import Clock

_PAUSE_S: Final = 1.0  # no tick may last longer; what is ticked later was not ticked meanwhile


class LeafClock:
    """The mission's time, less the pauses in which a leaf was not ticked because a person flew.

    The leaf calls `tick` in every tick before it asks for the time, and `stop` when it ends.

    Args:
        clock: the mission's.
    """

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._paused_s = 0.0
        self._ticked_s: float | None = None  # mission time; None while the leaf does not run
        self.resumed_s = -math.inf  # mission time when the last pause ended

    def now(self) -> float:
        """Return the leaf's time in seconds; only differences mean something."""
        return self._clock.now() - self._paused_s

    def tick(self) -> float:
        """Note a tick and return how long the pause before it lasted, seconds; 0 without one."""
        now_s, last_s = self._clock.now(), self._ticked_s
        self._ticked_s = now_s
        if last_s is None or now_s - last_s <= _PAUSE_S + 1e-6:
            return 0.0
        self._paused_s += now_s - last_s
        self.resumed_s = now_s
        return now_s - last_s

    def stop(self) -> None:
        """Note that the leaf has ended: until it begins again nothing is a pause."""
        self._ticked_s = None
