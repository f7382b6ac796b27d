"""Sizes of a drone and of a landing mark, and the distances that routes keep."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any, Final

from uav_bt.errors import ValueRangeError
from uav_bt.settings import check_numbers


@dataclass(frozen=True, kw_only=True)
class Airframe:
    """Size and reaction of a drone; the defaults are an ANAFI's, a camera drone of 0.3 kg."""

    # Length, width and height of the body with its propellers; an ANAFI's, rounded
    body_size_m: tuple[float, float, float] = (0.24, 0.32, 0.10)
    # Time from sending a command to its first effect; an estimate, not measured on a drone: the
    # twin's profiles delay by 0.09 s and 0.17 s
    command_delay_s: float = 0.15
    # Time constant of the velocity behind a command that has arrived; an estimate: the twin's
    # thrust lags by 0.12 s
    command_lag_s: float = 0.25
    # Vertical deceleration that the drone reaches; an estimate: the acceleration limit of the
    # twin's profile `lab`
    climb_braking_mps2: float = 1.0
    braking_mps2: float = 1.0  # the same horizontally; below the 1.2 m/s2 of that profile

    def __post_init__(self) -> None:
        positive = (*self.body_size_m, self.climb_braking_mps2, self.braking_mps2)
        if len(self.body_size_m) != 3 or not all(0.0 < value < math.inf for value in positive):
            expected = "three positive sizes in m and positive climb_braking_mps2, braking_mps2"
            raise ValueRangeError(f"an airframe needs {expected}, got {self}")
        if not all(0.0 <= time < math.inf for time in (self.command_delay_s, self.command_lag_s)):
            raise ValueRangeError(
                f"command_delay_s and command_lag_s must be 0 s or more, got {self}"
            )

    @property
    def radius_m(self) -> float:
        """Radius of the circle around the body's centre that holds the whole body, metres."""
        return math.hypot(self.body_size_m[0], self.body_size_m[1]) / 2.0


MAX_HEIGHT_M: Final = 2.0


@dataclass(frozen=True, kw_only=True)
class LandingMark:
    """Kind and size of the box or mat that carries the landing mark."""

    kind: str = "helipad"  # registered name of the plug-in that finds the mark
    length_m: float  # length of the top
    width_m: float  # width of the top
    height_m: float  # height of the top above the ground; 0 for a mark on the ground
    # Settings of that plug-in, such as the family and size of a tag
    options: Mapping[str, Any] = field(default_factory=dict, hash=False)

    def __post_init__(self) -> None:
        sides = (self.length_m, self.width_m)
        sized = all(0.0 < side_m < math.inf for side_m in sides)
        if not sized or not 0.0 <= self.height_m < MAX_HEIGHT_M:
            expected = f"a positive length and width and a height from 0 to {MAX_HEIGHT_M:g} m"
            raise ValueRangeError(f"a landing mark needs {expected}, got {self}")

    @property
    def size_m(self) -> tuple[float, float, float]:
        """Length, width and height, metres."""
        return self.length_m, self.width_m, self.height_m

    @property
    def top_m(self) -> tuple[float, float]:
        """Length and width of the top, metres."""
        return self.length_m, self.width_m

    @property
    def area_m2(self) -> float:
        """Area of the top."""
        return self.length_m * self.width_m

    @property
    def radius_m(self) -> float:
        """Radius of the circle around the top."""
        return math.hypot(self.length_m, self.width_m) / 2.0


@dataclass(frozen=True, kw_only=True)
class Clearances:
    """Distances from the body's centre that routes keep, metres; chosen in flights."""

    obstacle_m: float = 0.40
    """From obstacles: 0.2 m of hull, the map's drift and the sway; up to 0.1 m less in passages."""
    edge_m: float = 0.30
    """From the edge of the ground."""
    unknown_m: float = 0.35
    """From cells that were never seen: they may be an obstacle's hidden side."""
    lane_m: float = 0.7
    """From the path of a mover that may come back unseen."""

    def __post_init__(self) -> None:
        check_numbers(self, dict.fromkeys(vars(self), 0.0), dict.fromkeys(vars(self), 5.0))

    def below(self, radius_m: float) -> dict[str, float]:
        """Return the least value of each distance that is too small for a hull, by name."""
        least_m = {each.name: radius_m for each in fields(self)}
        least_m["obstacle_m"] = round(radius_m + NARROWER_M, 6)  # 0.2 and 0.1 are 0.3
        return {name: least for name, least in least_m.items() if getattr(self, name) < least}


NARROWER_M = 0.10  # the narrowest passage keeps this much less from obstacles; chosen
