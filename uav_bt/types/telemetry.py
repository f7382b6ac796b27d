"""What a drone reports about itself."""

from __future__ import annotations

import enum
from dataclasses import dataclass, field


@dataclass(frozen=True, kw_only=True)
class Attitude:
    """Body attitude, radians: roll right-down positive, pitch nose-up positive, yaw clockwise."""

    roll_rad: float = 0.0
    pitch_rad: float = 0.0
    yaw_rad: float = 0.0


@dataclass(frozen=True, kw_only=True)
class BodyVelocity:
    """Velocity in the heading-aligned body frame, metres a second."""

    forward_mps: float = 0.0
    right_mps: float = 0.0
    down_mps: float = 0.0


class FlyingState(enum.Enum):
    """Where the drone is in a flight (the ANAFI's flying states, less the ones we never see)."""

    LANDED = "landed"
    TAKING_OFF = "taking_off"
    HOVERING = "hovering"
    FLYING = "flying"
    LANDING = "landing"
    EMERGENCY = "emergency"


class MovementState(enum.Enum):
    """How a `MoveBy` is doing."""

    RUNNING = "running"
    DONE = "done"
    INTERRUPTED = "interrupted"
    REJECTED = "rejected"


@dataclass(frozen=True, kw_only=True)
class MovementStatus:
    """How the drone's latest `MoveBy` is doing."""

    id: int
    state: MovementState


@dataclass(frozen=True, kw_only=True)
class DroneFault:
    """Something that a drone reports about itself and that should be mended before a flight."""

    what: str  # the part, one or two words
    found: str
    remedy: str


@dataclass(frozen=True, kw_only=True)
class DroneState:
    """Telemetry that does not belong to a frame."""

    captured_s: float
    flying: FlyingState
    attitude: Attitude = field(default_factory=Attitude)
    velocity: BodyVelocity = field(default_factory=BodyVelocity)
    altitude_m: float = 0.0  # above the take-off point
    # Above the surface below, by a rangefinder; without one, at a fixed distance from the altitude.
    height_m: float = 0.0
    # As a drone reports it, at a fixed distance from the altitude; the mission estimates it anew.
    height_above_carpet_m: float = 0.0
    gimbal_pitch_rad: float = 0.0
    battery: float | None = 1.0  # 0 to 1; None before the drone has reported it
    link: float | None = 1.0  # the radio link's quality as the drone rates it, 0 to 1; as above
    movement: MovementStatus | None = None
    pilot_has_control: bool = False  # a person took over
    connected: bool = True  # False as soon as the connection is known to be broken
    lost: bool = False  # broken for good: the drone hears nothing and is not heard any more
    faults: tuple[DroneFault, ...] = ()
