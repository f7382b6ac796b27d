"""Commands to a drone, and the phases of the missions that send them."""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass

from uav_bt.errors import ValueRangeError


@dataclass(frozen=True, kw_only=True)
class TakeOff:
    """Start the motors and climb to the drone's own take-off height."""


@dataclass(frozen=True, kw_only=True)
class Land:
    """Descend on the spot and stop the motors."""


@dataclass(frozen=True, kw_only=True)
class Hover:
    """Hold the position."""


@dataclass(frozen=True, kw_only=True)
class CutMotors:
    """Stop the motors at once; the drone falls. An operator's last resort."""


@dataclass(frozen=True, kw_only=True)
class Release:
    """Send nothing: a person flies."""


@dataclass(frozen=True, kw_only=True)
class MoveBy:
    """A relative movement in the body frame at its start, whose end `MovementStatus` reports."""

    id: int  # of this movement
    forward_m: float = 0.0
    right_m: float = 0.0
    down_m: float = 0.0
    yaw_rad: float = 0.0

    def __post_init__(self) -> None:
        _check_finite(self, "a movement")


@dataclass(frozen=True, kw_only=True)
class Velocity:
    """Velocity piloting in the heading-aligned body frame; holds until the next command."""

    forward_mps: float = 0.0
    right_mps: float = 0.0
    down_mps: float = 0.0
    yaw_rate_radps: float = 0.0

    def __post_init__(self) -> None:
        _check_finite(self, "a velocity")


def _check_finite(command: MoveBy | Velocity, what: str) -> None:
    if not all(map(math.isfinite, vars(command).values())):
        raise ValueRangeError(f"{what} must be finite, got {command}")


Movement = TakeOff | Land | Hover | CutMotors | Release | MoveBy | Velocity


@dataclass(frozen=True, kw_only=True)
class GimbalTo:
    """Point the camera: 0 level, -pi/2 straight down."""

    pitch_rad: float

    def __post_init__(self) -> None:
        if not -math.pi / 2 - 1e-9 <= self.pitch_rad <= math.pi / 2 + 1e-9:
            raise ValueRangeError(f"gimbal pitch must be -pi/2 to pi/2 rad, got {self.pitch_rad}")


@dataclass(frozen=True, kw_only=True)
class Command:
    """The command of one tick: a movement, and separately the gimbal (None: unchanged)."""

    movement: Movement
    gimbal: GimbalTo | None = None


HOVER = Command(movement=Hover())


class Phase(enum.StrEnum):
    """Base class of all phases; a plug-in derives an enumeration with more members from it."""


class MissionPhase(Phase):
    """The phases of the shipped missions, from which the flight report takes its times."""

    TAKE_OFF = "take-off"
    EXPLORE = "explore"
    SEARCH = "search"  # exploration is over, the landing mark is not in view yet
    APPROACH = "approach"  # the landing mark was found
    CENTER = "center"
    LAND = "land"
    GO_TO = "go to"
    LOOK = "look"
    HOVER = "hover"
    EMERGENCY_LANDING = "emergency landing"
