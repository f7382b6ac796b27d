"""The answers of a leaf policy to a view: advance, follow a leg, rotate, blocked or done.

Each has a `reason`, one or two words for the status line and the records. A number of another type
or out of its range raises ValueRangeError.
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass
from numbers import Real
from typing import Final

import numpy as np

from uav_bt.errors import ValueRangeError

_TURN: Final = "a turn in radians, from -2 pi to 2 pi: for degrees write math.radians(...)"
_STEP: Final = "positive and finite: where the way is not free return Blocked"
# Least and greatest value of each number, and what is expected in words.
_RANGES: Final = {
    "forward_m": (math.ulp(0.0), sys.float_info.max, _STEP),
    "speed_mps": (0.0, sys.float_info.max, "finite, and zero or positive"),
    "free_m": (0.0, math.inf, "zero or positive, or None"),
    "yaw_rad": (-2.0 * math.pi, 2.0 * math.pi, _TURN),
}


@dataclass(frozen=True, kw_only=True)
class _Answer:
    """An answer whose numbers are within their ranges."""

    reason: str = ""  # one or two words

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if name not in _RANGES or (name == "free_m" and value is None):
                continue
            least, most, words = _RANGES[name]
            number = isinstance(value, Real) and not isinstance(value, bool)
            if not number or not least <= float(value) <= most:
                raise self._error(name, words, value)

    def _error(self, name: str, words: str, value: object) -> ValueRangeError:
        return ValueRangeError(f"{name} of {type(self).__name__} must be {words}, got {value!r}")


@dataclass(frozen=True, kw_only=True)
class Advance(_Answer):
    """Fly one step ahead. The drone stops at its end."""

    forward_m: float  # the length of the step
    yaw_rad: float = 0.0  # the turn during the step, clockwise positive, at most one full turn
    # The way ahead is free of obstacles up to this distance, even where the ground ends earlier. A
    # policy reports at most its longest step; None means that it does not know.
    free_m: float | None = None


@dataclass(frozen=True, kw_only=True)
class FollowLeg(_Answer):
    """Fly ahead at a speed while the heading turns to the leg, until the next answer."""

    yaw_rad: float = 0.0  # the bearing of the leg, clockwise positive, at most one full turn
    # The forward speed. At 0 the drone waits, for example for something that passes.
    speed_mps: float


@dataclass(frozen=True, kw_only=True)
class Rotate(_Answer):
    """Turn on the spot towards a heading, until the next answer. The way may be free."""

    yaw_rad: float  # the heading, relative to the present one, clockwise, at most one full turn


@dataclass(frozen=True, kw_only=True)
class Blocked(_Answer):
    """The way ahead is not free: turn away, and go on turning until it is."""

    yaw_rad: float  # the least turn, clockwise positive, at most one full turn
    ground_ends: bool = False  # the ground ends ahead
    free_m: float | None = None  # as of `Advance`

    def __post_init__(self) -> None:
        super().__post_init__()
        if not isinstance(self.ground_ends, bool | np.bool_):
            raise self._error("ground_ends", "True or False", self.ground_ends)


@dataclass(frozen=True, kw_only=True)
class Done(_Answer):
    """Nothing is left to do."""


Answer = Advance | FollowLeg | Rotate | Blocked | Done  # the result of `LeafPolicy.decide`
