"""A drone that flies on a circle, and its telemetry."""

from __future__ import annotations

import math

from uav_bt.types import Attitude, BodyVelocity, DroneState, FlyingState
from uav_bt.types.dead_reckoning import OdometryPose

TICK_S = 0.1


def state(
    time_s: float, yaw_rad: float = 0.0, forward_mps: float = 0.0, right_mps: float = 0.0
) -> DroneState:
    return DroneState(
        captured_s=time_s,
        flying=FlyingState.FLYING,
        attitude=Attitude(yaw_rad=yaw_rad),
        velocity=BodyVelocity(forward_mps=forward_mps, right_mps=right_mps),
    )


class Flight:
    """A drone on a circle: it flies ahead and turns clockwise, both at constant rates."""

    def __init__(self, speed_mps: float, yaw_rate_radps: float, yaw_rad: float = 0.4) -> None:
        self.speed_mps, self.rate, self.yaw_rad = speed_mps, yaw_rate_radps, yaw_rad

    def pose(self, time_s: float) -> OdometryPose:
        """The true pose; x and y start at the origin."""
        yaw = self.yaw_rad + self.rate * time_s
        radius = self.speed_mps / self.rate
        x = radius * (math.sin(yaw) - math.sin(self.yaw_rad))
        y = -radius * (math.cos(yaw) - math.cos(self.yaw_rad))
        return OdometryPose(time_s=time_s, x_m=x, y_m=y, yaw_rad=yaw)

    def state(self, time_s: float) -> DroneState:
        """The telemetry."""
        wrapped = math.remainder(self.yaw_rad + self.rate * time_s, 2 * math.pi)
        return state(time_s, wrapped, forward_mps=self.speed_mps)
