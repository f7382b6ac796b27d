"""The answers of a leaf policy to a view: advance, follow a leg, rotate, blocked or done."""

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
        reason: One or two words for the status line and the records.

    Raises:
        ValueRangeError: A number is of another type or out of its range.
    """

    forward_m: float
    yaw_rad: float = 0.0
    free_m: float | None = None
    reason: str = ""

    def __post_init__(self) -> None:
        _check_finite(self, "forward_m", self.forward_m)
        if self.forward_m <= 0.0:
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
        reason: One or two words for the status line and the records.

    Raises:
        ValueRangeError: A number is of another type or out of its range.
    """

    yaw_rad: float = 0.0
    speed_mps: float
    reason: str = ""

    def __post_init__(self) -> None:
        _check_yaw(self, self.yaw_rad)
        _check_finite(self, "speed_mps", self.speed_mps)
        if self.speed_mps < 0.0:
            raise ValueRangeError(
                f"speed_mps of a FollowLeg must be zero or positive, got {self.speed_mps:g}"
            )


@dataclass(frozen=True, kw_only=True)
class Rotate:
    """Turn on the spot towards a heading, until the next answer. The way may be free.

    Attributes:
        yaw_rad: The heading, relative to the present one, clockwise positive, at most one full
            turn.
        reason: One or two words for the status line and the records.

    Raises:
        ValueRangeError: The angle is of another type or out of its range.
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
        free_m: The way ahead is free of obstacles up to this distance, even where the ground ends
            earlier. A policy reports at most its longest step; None means that it does not know.
        reason: One or two words for the status line and the records.

    Raises:
        ValueRangeError: A value is of another type, or a number is out of its range.
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
    """Nothing is left to do.

    Attributes:
        reason: One or two words for the status line and the records.
    """

    reason: str = ""


Answer = Advance | FollowLeg | Rotate | Blocked | Done
"""The result of `LeafPolicy.decide`."""


def _check_number(answer: object, name: str, value: object) -> None:
    if isinstance(value, bool) or not isinstance(value, Real):
        raise ValueRangeError(f"{name} of {_named(answer)} must be a number, got {value!r}")


def _check_finite(answer: object, name: str, value: float) -> None:
    _check_number(answer, name, value)
    if not math.isfinite(value):
        raise ValueRangeError(f"{name} of {_named(answer)} must be finite, got {value}")


def _check_yaw(answer: object, yaw_rad: float) -> None:
    _check_number(answer, "yaw_rad", yaw_rad)
    if not abs(yaw_rad) <= 2.0 * math.pi:
        raise ValueRangeError(
            f"yaw_rad of {_named(answer)} must be a turn in radians, from -2 pi to 2 pi, "
            f"got {yaw_rad:g}: for degrees write math.radians(...)"
        )


def _check_free(answer: object, free_m: float | None) -> None:
    if free_m is None:
        return
    _check_number(answer, "free_m", free_m)
    if not free_m >= 0.0:
        raise ValueRangeError(
            f"free_m of {_named(answer)} must be zero or positive, got {free_m:g}"
        )


def _named(answer: object) -> str:
    name = type(answer).__name__
    return f"an {name}" if name[0] in "AEIOU" else f"a {name}"
