"""What a fault is: effects on what is observed, sent or followed, and what they depend on."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from uav_bt.types import Command, Observation


class InjectedError(RuntimeError):
    """What a fault raises: an error that nobody foresaw."""


@dataclass(frozen=True, kw_only=True)
class FaultMoment:
    """What an effect depends on."""

    level: float  # how bad it is, in the kind's unit; NaN where there are no degrees
    since_s: float  # since the fault's first effect, which has 0
    before: Observation  # the last one without the fault
    past: tuple[Observation, ...]  # of the drone itself, oldest first, the present one included
    command: Command | None  # the mission's latest


Observe = Callable[[Observation, FaultMoment], Observation]
Send = Callable[[Command, FaultMoment], Command]


@dataclass(frozen=True, kw_only=True)
class FaultKind:
    """A kind of fault, and what it does; all effects are optional."""

    name: str
    what: str  # for people
    level: float | None = None  # where it has degrees: the usual one
    observe: Observe | None = None  # changes what is observed
    send: Send | None = None  # changes what is sent
    disturb: Callable[[float], Mapping[str, tuple[float, float]]] | None = None  # pushes the drone
    follow: Callable[[], None] | None = None  # happens in every tick
    in_image: bool = False  # exact masks do not show it: it takes a network's view
