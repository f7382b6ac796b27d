"""Duration for which a condition has held."""

from __future__ import annotations


class Lasting:
    """Measures for how long a condition has held; a gap shorter than `gap_s` does not end it.

    So a video whose latency lies at its limit, fresh and stale in turn, counts as stale throughout.
    With a gap of 0 the first tick in which the condition does not hold ends it.
    """

    def __init__(self, *, gap_s: float = 1.0) -> None:
        self._gap_s = gap_s
        self._since_s: float | None = None  # None: it does not hold
        self._last_s = 0.0  # last time at which it held

    def update(self, now_s: float, *, holds: bool) -> float:
        """Return the seconds for which the condition has held, 0 if it does not hold now."""
        ends = self._gap_s > 0.0 or not holds
        if ends and now_s - self._last_s > self._gap_s:
            self._since_s = None
        if not holds:
            return 0.0
        if self._since_s is None:
            self._since_s = now_s
        self._last_s = now_s
        return now_s - self._since_s

    def reset(self) -> None:
        """Restart, as if the condition had not held."""
        self._since_s = None
