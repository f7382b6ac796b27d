"""Clocks. A mission has one, its drone's; nothing below the runner sleeps."""

from __future__ import annotations

import time
from typing import Final

from uav_bt.errors import ValueRangeError
from uav_bt.protocols import Clock

# Default time limit of a mission, seconds from the take-off command. Chosen: a fifth of the time
# that an ANAFI's battery lasts.
TIME_LIMIT_S: Final = 300.0


class ManualClock:
    """A clock that moves only when it is advanced, for tests and simulations."""

    def __init__(self, start_s: float = 0.0) -> None:
        self._now_s = start_s

    def now(self) -> float:
        """Return the time in seconds."""
        return self._now_s

    def advance(self, duration_s: float) -> None:
        """Move time forward."""
        if duration_s < 0.0:
            raise ValueRangeError(f"time only moves forward, got {duration_s} s")
        self._now_s += duration_s

    def sleep_until(self, time_s: float) -> None:
        """Jump to a time; a past time changes nothing."""
        self._now_s = max(self._now_s, time_s)


class WallClock:
    """Real seconds since the clock was made."""

    def __init__(self) -> None:
        self._start_s = time.monotonic()

    def now(self) -> float:
        """Return the time in seconds."""
        return time.monotonic() - self._start_s

    def sleep_until(self, time_s: float) -> None:
        """Sleep until a time; return at once when it has passed."""
        time.sleep(max(0.0, time_s - self.now()))  # noqa: TID251 - it is the clock


class TickClock:
    """The time of the present tick: everything in one tick happens at the same time.

    Simulated time stands still while a tick is computed. Real time does not, and a replay could
    not reproduce the times that leaves read.
    """

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._tick_s: float | None = None

    def begin_tick(self) -> float:
        """Read the drone's clock, hold that time until the next tick, and return it."""
        self._tick_s = self._clock.now()
        return self._tick_s

    def now(self) -> float:
        """Return the tick's time; before the first one, the drone's."""
        return self._clock.now() if self._tick_s is None else self._tick_s

    def sleep_until(self, time_s: float) -> None:
        """Let time pass; the tree sees it in the next tick."""
        self._clock.sleep_until(time_s)
