"""The live clock: the wall's time, and a tick when a frame arrives."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

__all__ = ["FrameClock"]


class FrameClock:
    """Real seconds since it was made; waiting ends with the next frame nobody has looked at.

    Args:
        patience_s: how long after the asked time a frame is waited for, so that a mission whose
            video stopped still ticks.
        monotonic: where the time comes from.
        condition: what is waited on and notified.
    """

    def __init__(
        self,
        *,
        patience_s: float = 0.1,
        monotonic: Callable[[], float] = time.monotonic,
        condition: threading.Condition | None = None,
    ) -> None:
        self._patience_s = patience_s
        self._monotonic = monotonic
        self._condition = condition or threading.Condition()
        self._start_s = monotonic()
        self._fresh = False

    def now(self) -> float:
        """Return the time in seconds."""
        return self._monotonic() - self._start_s

    def frame_arrived(self) -> None:
        """Wake who waits; called on the video's thread."""
        with self._condition:
            self._fresh = True
            self._condition.notify_all()

    def frame_seen(self) -> None:
        """Note that the newest frame was looked at: the next one is worth waiting for."""
        with self._condition:
            self._fresh = False

    def sleep_until(self, time_s: float) -> None:
        """Return at the first frame after a time, and after the patience without one."""
        with self._condition:
            while (left_s := time_s - self.now()) > 0.0:
                self._condition.wait(left_s)
            while not self._fresh and (left_s := time_s + self._patience_s - self.now()) > 0.0:
                self._condition.wait(left_s)
