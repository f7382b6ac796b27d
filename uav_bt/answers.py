"""The answers of a leaf policy to a view: advance, follow a leg, rotate, blocked or done.

Each has a `reason`, one or two words for the status line and the records. A number of another type
or out of its range raises ValueRangeError.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from numbers import Real

import numpy as np

from uav_bt.errors import ValueRangeError


@dataclass(frozen=True, kw_only=True)
class Advance:
    """Fly one step ahead. The drone stops at its end.

    Attributes:
        forward_m: The length of the step.
        yaw_rad: The turn during the step, clockwise positive, at most one full turn.
        free_m: The way ahead is free of obstacles up to this distance, even where the ground ends
            earlier. A policy reports at most its longest step; None means that it does not know.
        reason: One or two words.
    """

    forward_m: float
    yaw_rad: float = 0.0
    free_m: float | None = None
    reason: str = ""

    def __post_init__(self) -> None:
        if _finite(self, "forward_m", self.forward_m) <= 0.0:
            raise ValueRangeError(
                f"forward_m of an Advance must be positive, got {self.forward_m:g}: "
                "where the way is not free return Blocked"
            )
        _check_yaw(self, self.yaw_rad)
        _check_free(self, self.free_m)


@dataclass(frozen=True, kw_only=True)
class FollowLeg:
    """Fly ahead at a speed while the heading turns to the leg, until the next answer.

    Attributes:
        yaw_rad: The bearing of the leg, clockwise positive, at most one full turn.
        speed_mps: The forward speed. At 0 the drone waits, for example for something that passes.
        reason: One or two words.
    """

    yaw_rad: float = 0.0
    speed_mps: float
    reason: str = ""

    def __post_init__(self) -> None:
        _check_yaw(self, self.yaw_rad)
        if _finite(self, "speed_mps", self.speed_mps) < 0.0:
            raise ValueRangeError(
                f"speed_mps of a FollowLeg must be zero or positive, got {self.speed_mps:g}"
            )


@dataclass(frozen=True, kw_only=True)
class Rotate:
    """Turn on the spot towards a heading, until the next answer. The way may be free.

    Attributes:
        yaw_rad: The heading, relative to the present one, clockwise, at most one full turn.
        reason: One or two words.
    """

    yaw_rad: float
    reason: str = ""

    def __post_init__(self) -> None:
        _check_yaw(self, self.yaw_rad)


@dataclass(frozen=True, kw_only=True)
class Blocked:
    """The way ahead is not free: turn away, and go on turning until it is.

    Attributes:
        yaw_rad: The least turn, clockwise positive, at most one full turn.
        ground_ends: The ground ends ahead.
        free_m: As of `Advance`.
        reason: One or two words.
    """

    yaw_rad: float
    ground_ends: bool = False
    free_m: float | None = None
    reason: str = ""

    def __post_init__(self) -> None:
        _check_yaw(self, self.yaw_rad)
        if not isinstance(self.ground_ends, bool | np.bool_):
            raise ValueRangeError(
                f"ground_ends of a Blocked must be True or False, got {self.ground_ends!r}"
            )
        _check_free(self, self.free_m)


@dataclass(frozen=True, kw_only=True)
class Done:
    """Nothing is left to do."""

    reason: str = ""


Answer = Advance | FollowLeg | Rotate | Blocked | Done  # the result of `LeafPolicy.decide`


def _of(answer: object, name: str) -> str:
    kind = type(answer).__name__
    return f"{name} of {'an' if kind[0] in 'AEIOU' else 'a'} {kind} must be"


def _number(answer: object, name: str, value: float) -> float:
    if isinstance(value, bool) or not isinstance(value, Real):
        raise ValueRangeError(f"{_of(answer, name)} a number, got {value!r}")
    return value


def _finite(answer: object, name: str, value: float) -> float:
    if not math.isfinite(_number(answer, name, value)):
        raise ValueRangeError(f"{_of(answer, name)} finite, got {value}")
    return value


def _check_yaw(answer: object, yaw_rad: float) -> None:
    if not abs(_number(answer, "yaw_rad", yaw_rad)) <= 2.0 * math.pi:
        raise ValueRangeError(
            f"{_of(answer, 'yaw_rad')} a turn in radians, from -2 pi to 2 pi, got {yaw_rad:g}: "
            "for degrees write math.radians(...)"
        )


def _check_free(answer: object, free_m: float | None) -> None:
    if free_m is not None and not _number(answer, "free_m", free_m) >= 0.0:
        raise ValueRangeError(f"{_of(answer, 'free_m')} zero or positive, got {free_m:g}")
