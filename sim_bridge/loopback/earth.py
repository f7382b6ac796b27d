"""Metres around home, and degrees on earth."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

__all__ = ["HOME", "Location", "offset_m", "place"]

_EQUATOR_M: Final = 6_378_137.0  # WGS84
_SQUEEZE: Final = 0.00669437999014  # WGS84's first eccentricity, squared


@dataclass(frozen=True, kw_only=True)
class Location:
    """A place on earth."""

    latitude_deg: float
    longitude_deg: float
    altitude_m: float = 0.0  # above the take-off point


# Where Parrot's simulator Sphinx puts its drones: scripts that name a place were written for it.
HOME: Final = Location(latitude_deg=48.878900, longitude_deg=2.367780)


def _metres_per_degree(latitude_deg: float) -> tuple[float, float]:
    """Return the lengths of a degree of latitude and of longitude (WGS84's radii of curvature)."""
    latitude = math.radians(latitude_deg)
    bulge = 1.0 - _SQUEEZE * math.sin(latitude) ** 2
    meridian_m = _EQUATOR_M * (1.0 - _SQUEEZE) / bulge**1.5
    parallel_m = _EQUATOR_M / math.sqrt(bulge) * math.cos(latitude)
    return math.radians(meridian_m), math.radians(parallel_m)


def place(north_m: float, east_m: float, altitude_m: float = 0.0) -> Location:
    """Return the place that lies so far from home; for distances of some kilometres."""
    north, east = _metres_per_degree(HOME.latitude_deg)
    return Location(
        latitude_deg=HOME.latitude_deg + north_m / north,
        longitude_deg=HOME.longitude_deg + east_m / east,
        altitude_m=altitude_m,
    )


def offset_m(latitude_deg: float, longitude_deg: float) -> tuple[float, float]:
    """Return how far north and east of home a place lies, metres."""
    north, east = _metres_per_degree(HOME.latitude_deg)
    return (
        (latitude_deg - HOME.latitude_deg) * north,
        (longitude_deg - HOME.longitude_deg) * east,
    )
