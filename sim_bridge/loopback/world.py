"""State of the loopback ANAFI's body, and places on earth.

Positions are metres north and east of the world's origin, whose geographic position is `HOME`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from uav_bt.types import DroneState

SATELLITES: Final = 14  # number of satellites that clients are shown
LINK_QUALITY: Final = 5  # best value of 1 to 5: a loopback loses no packets
RSSI_DBM: Final = -35


@dataclass(frozen=True, kw_only=True)
class WorldState(DroneState):
    """Telemetry of the body (yaw clockwise from north), and its position."""

    lifting: bool = False  # whether the drone has left the ground; false during the spin-up
    north_m: float = 0.0  # north of the world's origin
    east_m: float = 0.0
    turned_rad: float = 0.0  # yaw without wrapping


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
_LATITUDE_M: Final = 111_207.391  # length of a degree at home, from WGS84's radii of curvature
_LONGITUDE_M: Final = 73_349.025


def location(north_m: float, east_m: float, altitude_m: float = 0.0) -> Location:
    """Return the geographic position at an offset from home, for offsets of some kilometres."""
    return Location(
        latitude_deg=HOME.latitude_deg + north_m / _LATITUDE_M,
        longitude_deg=HOME.longitude_deg + east_m / _LONGITUDE_M,
        altitude_m=altitude_m,
    )


def offset_m(latitude_deg: float, longitude_deg: float) -> tuple[float, float]:
    """Return the offset of a point north and east of home, m."""
    return (
        (latitude_deg - HOME.latitude_deg) * _LATITUDE_M,
        (longitude_deg - HOME.longitude_deg) * _LONGITUDE_M,
    )
