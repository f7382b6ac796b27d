"""One timeline for a record: mission seconds on top of the wall-clock time of the start."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

__all__ = ["Timeline"]

_NS: Final = 1_000_000_000


@dataclass(frozen=True, kw_only=True)
class Timeline:
    """Where mission seconds stand on a record's timeline.

    The exact mission time stands in the messages; a nanosecond of rounding is lost here.
    """

    start_ns: int  # wall clock, since 1970
    start_s: float  # the mission clock at that moment

    def at(self, time_s: float) -> int:
        """Return the record's time of a mission time, nanoseconds since 1970."""
        return max(0, self.start_ns + round((time_s - self.start_s) * _NS))

    def since_start(self, time_ns: int) -> float:
        """Return the seconds from the record's start to one of its times."""
        return (time_ns - self.start_ns) / _NS
