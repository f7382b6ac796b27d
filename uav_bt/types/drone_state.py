"""The telemetry of a drone."""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass, field, fields, replace

from uav_bt.errors import ValueRangeError


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
    """Flying state of the drone (the ANAFI's states without those that do not occur)."""

    LANDED = "landed"
    TAKING_OFF = "taking_off"
    HOVERING = "hovering"
    FLYING = "flying"
    LANDING = "landing"
    EMERGENCY = "emergency"


class MovementState(enum.Enum):
    """State of a `MoveBy`."""

    RUNNING = "running"
    DONE = "done"
    INTERRUPTED = "interrupted"
    REJECTED = "rejected"


@dataclass(frozen=True, kw_only=True)
class MovementStatus:
    """State of the drone's latest `MoveBy`."""

    id: int
    state: MovementState


@dataclass(frozen=True, kw_only=True)
class DroneFault:
    """A fault that a drone reports about itself, to be repaired before a flight."""

    what: str  # the part, one or two words
    found: str
    remedy: str


@dataclass(frozen=True, kw_only=True)
class MeasurementTimes:
    """Capture time of each quantity of a `DroneState`: seconds, mission clock; -inf: never."""

    attitude_s: float
    velocity_s: float
    altitude_s: float
    height_s: float
    gimbal_s: float

    @staticmethod
    def all_at(time_s: float) -> MeasurementTimes:
        """Return the times of quantities that were all measured at one time."""
        return MeasurementTimes(**dict.fromkeys(_QUANTITIES, time_s))

    @property
    def oldest_s(self) -> float:
        """The oldest time of attitude, velocity and altitude, by which the drone is flown.

        NaN if one of the three is NaN.
        """
        flown_by_s = (self.attitude_s, self.velocity_s, self.altitude_s)
        return math.nan if any(map(math.isnan, flown_by_s)) else min(flown_by_s)

    def shifted(self, later_s: float) -> MeasurementTimes:
        """Return the times moved by a number of seconds."""
        return MeasurementTimes(**{name: getattr(self, name) + later_s for name in _QUANTITIES})


_QUANTITIES = tuple(item.name for item in fields(MeasurementTimes))


@dataclass(frozen=True, kw_only=True)
class DroneState:
    """Telemetry that does not belong to a frame.

    A drone that stamps each quantity gives `measured`, and `captured_s` is its oldest part. A drone
    that has one time for all gives only `captured_s`.
    """

    captured_s: float
    flying: FlyingState
    attitude: Attitude = field(default_factory=Attitude)
    velocity: BodyVelocity = field(default_factory=BodyVelocity)
    altitude_m: float = 0.0  # above the take-off point
    # Above the surface below, by a rangefinder; without one, at a fixed distance from the altitude.
    height_m: float = 0.0
    # A drone reports it at a fixed distance from the altitude; the mission estimates it anew.
    height_above_ground_m: float = 0.0
    gimbal_pitch_rad: float = 0.0
    battery: float | None = 1.0  # 0 to 1; None before the drone has reported it
    link: float | None = 1.0  # quality of the radio link, rated by the drone, 0 to 1; None as above
    movement: MovementStatus | None = None
    pilot_has_control: bool = False  # a person took over
    connected: bool = True  # False as soon as the connection is known to be broken
    lost: bool = False  # broken for good, in both directions
    faults: tuple[DroneFault, ...] = ()
    measured: MeasurementTimes | None = None  # None: every quantity at `captured_s`

    def __post_init__(self) -> None:
        if self.measured is None:
            return
        oldest_s = self.measured.oldest_s
        if self.captured_s != oldest_s and not math.isnan(oldest_s):
            raise ValueRangeError(
                f"captured_s must be the oldest of attitude, velocity and altitude, {oldest_s} s, "
                f"got {self.captured_s} s; `dated` changes it together with the parts"
            )

    @property
    def times(self) -> MeasurementTimes:
        """Capture time of each quantity."""
        return self.measured or MeasurementTimes.all_at(self.captured_s)

    @property
    def in_air(self) -> bool:
        """Whether the drone has taken off and not landed; False also after its motors were cut."""
        return self.flying not in {FlyingState.LANDED, FlyingState.EMERGENCY}

    def dated(self, captured_s: float) -> DroneState:
        """Return the state with another capture time; the times of its parts shift equally."""
        if self.measured is None:
            return replace(self, captured_s=captured_s)
        measured = self.measured.shifted(captured_s - self.captured_s)
        return replace(self, captured_s=measured.oldest_s, measured=measured)
