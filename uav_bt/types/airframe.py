"""The size of a drone's body and its reaction to commands."""

from __future__ import annotations

import math
from dataclasses import dataclass

from uav_bt.errors import ValueRangeError


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
            raise ValueRangeError(
                "an airframe needs three positive sizes (length, width, height in m) and a "
                f"positive climb_braking_mps2 and braking_mps2, got {self}"
            )
        if not all(0.0 <= time < math.inf for time in (self.command_delay_s, self.command_lag_s)):
            raise ValueRangeError(
                f"command_delay_s and command_lag_s must be zero or positive seconds, got {self}"
            )

    @property
    def radius_m(self) -> float:
        """Radius of the circle around the body's centre that holds the whole body, metres."""
        return math.hypot(self.body_size_m[0], self.body_size_m[1]) / 2.0
