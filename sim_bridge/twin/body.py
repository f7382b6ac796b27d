"""The body that a simulation steps: its size, its motion, and what physics must offer."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Protocol

from sim_bridge.anafi import ANAFI_AIRFRAME
from uav_bt.types import MoverState, Pose, rotate

HULL_HALF_M: Final = tuple(side / 2 for side in ANAFI_AIRFRAME.body_size_m)  # forward, aside, up
CONTROL_STEP_S: Final = 0.01
GRAVITY_MPS2: Final = 9.81
TILT_RADPS: Final = 18.0  # bandwidth of the attitude loop, rad/s; faster than the thrust


@dataclass(frozen=True, kw_only=True, slots=True)
class Motion(Pose):
    """True motion of the body's centre; world axes, yaw counter-clockwise."""

    vx_mps: float
    vy_mps: float
    vz_mps: float
    roll_rad: float  # about the forward axis, right-down positive
    pitch_rad: float  # nose-up positive
    yaw_rate_radps: float


class Body(Protocol):
    """The drone's body in the physics of a lab."""

    def place(self, x_m: float, y_m: float, z_m: float, yaw_rad: float) -> None:
        """Place the body at a pose, at rest and level."""
        ...

    def motion(self) -> Motion:
        """Return the present motion."""
        ...

    def fly(
        self,
        motion: Motion,
        demand_mps2: tuple[float, float, float],
        yaw_demand_radps2: float,
        wind_mps2: tuple[float, float, float],
    ) -> None:
        """Set the forces of the next control step.

        Args:
            motion: the present motion.
            demand_mps2: demanded acceleration, world axes, without gravity.
            yaw_demand_radps2: demanded yaw acceleration, counter-clockwise.
            wind_mps2: acceleration by the wind, world axes.
        """
        ...

    def drop(self) -> None:
        """Remove all forces: the motors are off."""
        ...

    def place_movers(self, movers: Sequence[MoverState]) -> None:
        """Place the movers, in the order of the scene."""
        ...

    def advance(self) -> None:
        """Advance the physics by one control step."""
        ...

    def contacts(self) -> tuple[str, ...]:
        """Return the names of the solids that the hull touches now, sorted."""
        ...

    def clearance_m(self) -> float:
        """Return the distance from the hull to the nearest obstacle; inf without any."""
        ...


class Thrust:
    """Acceleration by the rotors: the demanded one behind a first-order lag.

    Args:
        lag_s: time constant from demanded to real acceleration, s.
    """

    def __init__(self, lag_s: float) -> None:
        self._gain = 1.0 - math.exp(-CONTROL_STEP_S / lag_s) if lag_s > 0.0 else 1.0
        self._acceleration = [0.0, 0.0, 0.0]

    def stop(self) -> None:
        """Set the acceleration to zero."""
        self._acceleration = [0.0, 0.0, 0.0]

    def follow(self, demand_mps2: tuple[float, float, float]) -> list[float]:
        """Advance by one control step and return the acceleration, world axes, m/s2."""
        acceleration, gain = self._acceleration, self._gain
        for axis in range(3):
            acceleration[axis] += gain * (demand_mps2[axis] - acceleration[axis])
        return acceleration


def tilt_for(acceleration_mps2: Sequence[float], yaw_rad: float) -> tuple[float, float]:
    """Return roll and pitch, rad, at which the rotors produce an acceleration.

    The rotors push along the body's up axis, so a horizontal acceleration needs a tilt.

    Args:
        acceleration_mps2: acceleration, world axes, without gravity.
        yaw_rad: heading, counter-clockwise.
    """
    ax, ay, az = acceleration_mps2
    lift = max(GRAVITY_MPS2 + az, 1.0)
    forward, left = rotate(ax, ay, -yaw_rad)
    return -math.atan2(left, math.hypot(forward, lift)), -math.atan2(forward, lift)
