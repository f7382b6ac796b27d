"""Control law of the twin: PD control from the reference and the estimate to accelerations."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from sim_bridge.twin.profile import Profile
from sim_bridge.twin.reference import Reference
from sim_bridge.twin.sensors import Estimate
from uav_bt.types.pose import clamp, limit_length

# Gains of the position loop: critically damped at 2 rad/s, far below the bandwidth of the thrust.
_POSITION_GAIN: Final = 4.0  # 1/s2
_VELOCITY_GAIN: Final = 4.0  # 1/s
_YAW_GAIN: Final = 36.0  # 1/s2, critically damped at 6 rad/s
_YAW_RATE_GAIN: Final = 12.0  # 1/s


@dataclass(frozen=True, kw_only=True, slots=True)
class Demand:
    """Demanded accelerations; world axes, yaw counter-clockwise."""

    acceleration_mps2: tuple[float, float, float]  # without gravity
    yaw_acceleration_radps2: float


def demand(reference: Reference, estimate: Estimate, profile: Profile) -> Demand:
    """Return the accelerations that make the drone follow its reference.

    Args:
        reference: the wanted pose, velocity and acceleration.
        estimate: the drone's estimate of its pose and velocity.
        profile: the drone's limits.
    """
    here = (estimate.x_m, estimate.y_m, estimate.z_m)
    speed = (estimate.vx_mps, estimate.vy_mps, estimate.vz_mps)
    wanted = [
        reference.acceleration[axis]
        + _VELOCITY_GAIN * (reference.trailing_velocity[axis] - speed[axis])
        + _POSITION_GAIN * (reference.trailing[axis] - here[axis])
        for axis in range(3)
    ]
    # Corrections may exceed the limits of the reference, but the tilt stays bounded.
    flat_limit = 2.0 * profile.max_acceleration_mps2
    flat = limit_length(wanted[0], wanted[1], flat_limit)
    rise = clamp(wanted[2], 2.0 * profile.max_climb_acceleration_mps2)
    turn = _YAW_GAIN * reference.yaw_error(estimate.yaw_rad) + _YAW_RATE_GAIN * (
        reference.yaw_rate_radps - estimate.yaw_rate_radps
    )
    return Demand(
        acceleration_mps2=(*flat, rise),
        yaw_acceleration_radps2=turn,
    )
