"""Clock of a leaf, which stops while the leaf is not ticked."""

from __future__ import annotations

import math
from typing import Final

from uav_bt.protocols import Clock

_PAUSE_S: Final = 1.0  # a longer time between two ticks is a pause; no tick takes this long


class LeafClock:
    """The mission's time without pauses, in which a pilot flew; `tick` comes before `now`."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._paused_s = 0.0
        self._ticked_s: float | None = None  # mission time; None while the leaf does not run
        self.resumed_s = -math.inf  # mission time when the last pause ended

    def now(self) -> float:
        """Return the leaf's time in seconds; only differences are meaningful."""
        return self._clock.now() - self._paused_s

    def tick(self) -> float:
        """Note a tick and return the length of the pause before it, seconds; 0 without a pause."""
        now_s, last_s = self._clock.now(), self._ticked_s
        self._ticked_s = now_s
        if last_s is None or now_s - last_s <= _PAUSE_S + 1e-6:
            return 0.0
        self._paused_s += now_s - last_s
        self.resumed_s = now_s
        return now_s - last_s

    def stop(self) -> None:
        """Note that the leaf has ended: the time until it begins again is not a pause."""
        self._ticked_s = None
