"""A fault as a value and as a text: kind, level, and time."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, Self

from uav_bt.errors import UnknownNameError, ValueRangeError
from uav_bt.testing.faults.table import FAULTS, FaultKind

RANDOM: Final = "random"
"""In place of a fault: room, movers and faults are drawn from the seed."""
START: Final = "start"  # in place of a phase: from the connection on
_TEXT: Final = re.compile(
    r"(?P<kind>[\w-]+)(=(?P<level>[^@~]+))?"
    r"(@(?P<phase>[^+~=@]+)(\+(?P<delay>[^~]+))?)?(~(?P<duration>.+))?"
)


@dataclass(frozen=True, kw_only=True)
class Fault:
    """A kind of fault with its level and its time."""

    kind: FaultKind
    level: float | None = None  # None: the kind's default
    phase: str = START  # it begins with the first tick of this phase of the mission
    delay_s: float = 0.0  # time from the start of the phase to the fault
    duration_s: float = math.inf  # from its first effect on

    def __post_init__(self) -> None:
        kind, level = self.kind, self.level
        if not (math.isfinite(self.delay_s) and self.delay_s >= 0.0):
            raise ValueRangeError(f"expected a delay of 0 s or more, got {self.delay_s:g}")
        if not self.duration_s > 0.0:
            raise ValueRangeError(
                f"expected a duration of more than 0 s, got {self.duration_s:g}; a fault without a "
                "duration stays"
            )
        if level is not None and kind.level is None:
            raise ValueRangeError(f"{kind.name} takes no level, got {level:g}")
        if level is not None and not (math.isfinite(level) and kind.least <= level <= kind.most):
            limits = f"{kind.least:g} to {kind.most:g} {kind.unit}".rstrip()
            raise ValueRangeError(f"expected a finite level from {limits}, got {level:g}")

    @classmethod
    def parse(cls, text: str, kinds: Mapping[str, FaultKind] = FAULTS) -> Self:
        """Return the fault that a text like ``late=0.7@explore+1~30`` describes.

        Args:
            text: ``KIND[=LEVEL][@PHASE[+DELAY]][~DURATION]``, times in seconds.
            kinds: by name.
        """
        found = _TEXT.fullmatch(text)
        if found is None:
            raise ValueRangeError(
                f"a fault is written KIND[=LEVEL][@PHASE[+DELAY]][~DURATION], got '{text}'"
            )
        if found["kind"] == RANDOM:
            raise ValueRangeError(f"'{RANDOM}' takes no level and no time, got '{text}'")
        if found["kind"] not in kinds:
            raise UnknownNameError("fault", found["kind"], [*kinds, RANDOM])
        try:
            return cls(
                kind=kinds[found["kind"]],
                level=None if found["level"] is None else _number("level", found["level"]),
                phase=found["phase"] or START,
                delay_s=_number("delay", found["delay"] or "0"),
                duration_s=_number("duration", found["duration"] or "inf"),
            )
        except ValueError as error:
            raise ValueRangeError(f"fault '{text}': {error}") from error

    def __str__(self) -> str:
        level = "" if self.level is None else f"={self.level:g}"
        delay = f"+{self.delay_s:g}" if self.delay_s else ""
        duration = f"~{self.duration_s:g}" if math.isfinite(self.duration_s) else ""
        return f"{self.kind.name}{level}@{self.phase}{delay}{duration}"


def _number(what: str, text: str) -> float:
    try:
        return float(text)
    except ValueError as error:
        raise ValueRangeError(f"expected a number as {what}, got '{text}'") from error
