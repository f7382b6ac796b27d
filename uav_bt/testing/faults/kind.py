"""Kinds of faults: their effects, and the inputs of these effects."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from uav_bt.types import Command, Frame, Observation


class InjectedError(RuntimeError):
    """The error that a fault raises: one that no code expects."""


@dataclass(frozen=True, kw_only=True)
class FaultMoment:
    """The inputs of an effect."""

    level: float  # strength, in the kind's unit; NaN for a kind without a level
    since_s: float  # time since the fault's first effect
    before: Observation  # the last observation without the fault, or else the first one
    still: Frame | None  # the last frame without the fault, or else the first one
    past: tuple[Observation, ...]  # without the fault, oldest first, up to the present one
    command: Command | None  # the mission's latest command


Observe = Callable[[Observation, FaultMoment], Observation]
Send = Callable[[Command, FaultMoment], Command]


@dataclass(frozen=True)
class FaultKind:
    """A kind of fault with its effects, all of them optional."""

    name: str
    what: str  # description for people
    observe: Observe | None = None  # changes the observation
    level: float | None = None  # default strength; None: it has no strength
    unit: str = ""  # of the level
    least: float = -math.inf  # levels from here
    most: float = math.inf  # to here can be given
    send: Send | None = None  # changes the command
    # Arguments of the drone's `disturb`, from the level.
    disturb: Callable[[float], Mapping[str, tuple[float, float]]] | None = None
    follow: Callable[[], None] | None = None  # happens in every tick
    in_image: bool = False  # only networks notice it; exact masks stay as they are
