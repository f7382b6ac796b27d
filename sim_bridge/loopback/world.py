"""The world of the loopback ANAFI: the protocol between its firmware and what moves the body.

Positions are metres north and east of the world's origin, which lies at `HOME` on earth. The twin
is one world (`twin_world`); tests have a simple one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Final, Protocol

from sim_bridge.twin.reference import Pace
from uav_bt.errors import ValueRangeError
from uav_bt.types import Attitude, BodyVelocity, FlyingState, Movement, MovementStatus

SATELLITES: Final = 14  # of its position fix, as clients are shown
LINK_QUALITY: Final = 5  # of 5: a loopback loses nothing
RSSI_DBM: Final = -35
UNKNOWN: Final = 500.0  # ARSDK's value for a latitude, longitude or altitude without a fix
_EQUATOR_M: Final = 6_378_137.0  # WGS84's semi-major axis
_ECCENTRICITY_2: Final = 0.00669437999014  # WGS84's first eccentricity, squared


@dataclass(frozen=True, kw_only=True)
class WorldLimits:
    """What the body can do there.

    Raises:
        ValueRangeError: a limit is not positive.
    """

    max_speed_mps: float = 1.0  # m/s, horizontal
    max_climb_mps: float = 0.6  # m/s, up and down
    max_yaw_rate_radps: float = 1.4  # rad/s
    ceiling_m: float = math.inf  # m above the take-off point that the firmware keeps below

    def __post_init__(self) -> None:
        limits = (self.max_speed_mps, self.max_climb_mps, self.max_yaw_rate_radps, self.ceiling_m)
        if not all(limit > 0.0 for limit in limits):
            raise ValueRangeError(f"a world's limits must be positive, got {self}")


@dataclass(frozen=True, kw_only=True)
class WorldState:
    """What the drone's sensors measure."""

    time_s: float = 0.0
    flying: FlyingState = FlyingState.LANDED
    lifting: bool = False  # whether it has left the ground; false while the motors spin up
    attitude: Attitude = field(default_factory=Attitude)  # yaw clockwise from north
    velocity: BodyVelocity = field(default_factory=BodyVelocity)
    north_m: float = 0.0  # from the world's origin
    east_m: float = 0.0
    altitude_m: float = 0.0  # above the take-off point
    height_m: float = 0.0  # above the surface below
    gimbal_pitch_rad: float = 0.0
    movement: MovementStatus | None = None


class World(Protocol):
    """Moves a body; may be called from another thread than its own."""

    @property
    def limits(self) -> WorldLimits:
        """What the body can do."""

    def state(self) -> WorldState:
        """Return the newest state; never blocks."""

    def move(self, movement: Movement, pace: Pace | None = None) -> None:
        """Order a movement; it replaces the one before. A `MoveBy` is ordered once, by its id.

        Args:
            movement: the movement.
            pace: of a `MoveBy`, within the body's limits; None flies it as fast as they allow.
        """

    def point(self, pitch_rad: float) -> None:
        """Turn the camera: 0 level, negative down; within -pi/2 and pi/2."""


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


GROUND_M: Final = 62.0  # of the world's ground above sea level, as GPS has it there

# Where Parrot's simulator Sphinx puts its drones: scripts that name a place were written for it.
HOME: Final = Location(latitude_deg=48.878900, longitude_deg=2.367780)


def _metres_per_degree(latitude_deg: float) -> tuple[float, float]:
    """Return the lengths of a degree of latitude and of longitude (WGS84's radii of curvature)."""
    latitude = math.radians(latitude_deg)
    bulge = 1.0 - _ECCENTRICITY_2 * math.sin(latitude) ** 2
    meridian_m = _EQUATOR_M * (1.0 - _ECCENTRICITY_2) / bulge**1.5
    parallel_m = _EQUATOR_M / math.sqrt(bulge) * math.cos(latitude)
    return math.radians(meridian_m), math.radians(parallel_m)


def location(north_m: float, east_m: float, altitude_m: float = 0.0) -> Location:
    """Return the point on earth at an offset from home; for distances of some kilometres.

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
    """Return how far north and east of home a point lies, m.

    Args:
        latitude_deg: the point's latitude.
        longitude_deg: the point's longitude.
    """
    north, east = _metres_per_degree(HOME.latitude_deg)
    return (
        (latitude_deg - HOME.latitude_deg) * north,
        (longitude_deg - HOME.longitude_deg) * east,
    )
