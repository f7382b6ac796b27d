"""World of the loopback ANAFI: the protocol between its firmware and the simulated body.

Positions are metres north and east of the world's origin, whose geographic position is `HOME`. The
twin is one implementation (`twin_world`); tests use a simpler one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Final, Protocol

from sim_bridge.twin.reference import Pace
from uav_bt.errors import ValueRangeError
from uav_bt.types import Attitude, BodyVelocity, FlyingState, Movement, MovementStatus

SATELLITES: Final = 14  # number of satellites that clients are shown
LINK_QUALITY: Final = 5  # best value of 1 to 5: a loopback loses no packets
RSSI_DBM: Final = -35
UNKNOWN: Final = 500.0  # ARSDK's value of an unknown latitude, longitude or altitude
_EQUATOR_M: Final = 6_378_137.0  # semi-major axis of WGS84
_ECCENTRICITY_2: Final = 0.00669437999014  # squared first eccentricity of WGS84


@dataclass(frozen=True, kw_only=True)
class WorldLimits:
    """Limits of the body in its world.

    Raises:
        ValueRangeError: a limit is not positive.
    """

    max_speed_mps: float = 1.0  # m/s, horizontal
    max_climb_mps: float = 0.6  # m/s, up and down
    max_yaw_rate_radps: float = 1.4  # rad/s
    ceiling_m: float = math.inf  # altitude limit of the firmware above the take-off point, m

    def __post_init__(self) -> None:
        limits = (self.max_speed_mps, self.max_climb_mps, self.max_yaw_rate_radps, self.ceiling_m)
        if not all(limit > 0.0 for limit in limits):
            raise ValueRangeError(f"a world's limits must be positive, got {self}")


@dataclass(frozen=True, kw_only=True)
class WorldState:
    """Measurements of the drone's sensors."""

    time_s: float = 0.0
    flying: FlyingState = FlyingState.LANDED
    lifting: bool = False  # whether the drone has left the ground; false during the spin-up
    attitude: Attitude = field(default_factory=Attitude)  # yaw clockwise from north
    velocity: BodyVelocity = field(default_factory=BodyVelocity)
    north_m: float = 0.0  # north of the world's origin
    east_m: float = 0.0
    altitude_m: float = 0.0  # above the take-off point
    height_m: float = 0.0  # above the surface below
    gimbal_pitch_rad: float = 0.0
    movement: MovementStatus | None = None


class World(Protocol):
    """Moves a body; its methods may be called from any thread."""

    @property
    def limits(self) -> WorldLimits:
        """The limits of the body."""

    def state(self) -> WorldState:
        """Return the newest state; never blocks."""

    def move(self, movement: Movement, pace: Pace | None = None) -> None:
        """Command a movement; it replaces the last one. A `MoveBy` id is executed only once.

        Args:
            movement: the movement.
            pace: speed limits of a `MoveBy`, within the body's limits; None uses the latter.
        """

    def point(self, pitch_rad: float) -> None:
        """Set the pitch of the camera: 0 level, negative down, within -pi/2 and pi/2."""


@dataclass(frozen=True, kw_only=True)
class Location:
    """A point on earth."""

    latitude_deg: float
    longitude_deg: float
    altitude_m: float = 0.0  # above the take-off point

    @property
    def arguments(self) -> dict[str, float]:
        """The point as arguments of an ARSDK event."""
        return {
            "latitude": self.latitude_deg,
            "longitude": self.longitude_deg,
            "altitude": self.altitude_m,
        }


GROUND_M: Final = 62.0  # altitude of the ground above sea level by GPS

# Start position in Parrot's simulator Sphinx; scripts with coordinates were written for it.
HOME: Final = Location(latitude_deg=48.878900, longitude_deg=2.367780)


def _metres_per_degree(latitude_deg: float) -> tuple[float, float]:
    """Return the lengths of a degree of latitude and of longitude (WGS84's radii of curvature)."""
    latitude = math.radians(latitude_deg)
    bulge = 1.0 - _ECCENTRICITY_2 * math.sin(latitude) ** 2
    meridian_m = _EQUATOR_M * (1.0 - _ECCENTRICITY_2) / bulge**1.5
    parallel_m = _EQUATOR_M / math.sqrt(bulge) * math.cos(latitude)
    return math.radians(meridian_m), math.radians(parallel_m)


def location(north_m: float, east_m: float, altitude_m: float = 0.0) -> Location:
    """Return the geographic position at an offset from home, for offsets of some kilometres.

    Args:
        north_m: m north of home.
        east_m: m east of home.
        altitude_m: m above the take-off point.
    """
    north, east = _metres_per_degree(HOME.latitude_deg)
    return Location(
        latitude_deg=HOME.latitude_deg + north_m / north,
        longitude_deg=HOME.longitude_deg + east_m / east,
        altitude_m=altitude_m,
    )


def offset_m(latitude_deg: float, longitude_deg: float) -> tuple[float, float]:
    """Return the offset of a point north and east of home, m.

    Args:
        latitude_deg: the point's latitude.
        longitude_deg: the point's longitude.
    """
    north, east = _metres_per_degree(HOME.latitude_deg)
    return (
        (latitude_deg - HOME.latitude_deg) * north,
        (longitude_deg - HOME.longitude_deg) * east,
    )
