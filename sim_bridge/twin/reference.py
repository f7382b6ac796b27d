"""Reference of the autopilot: a moving point within the speed and acceleration limits."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from sim_bridge.twin.body import CONTROL_STEP_S, lag_gain
from sim_bridge.twin.profile import Profile
from uav_bt.types import Pose, wrap_angle
from uav_bt.types.pose import clamp

_BRAKE_SHARE: Final = 0.7  # share of the acceleration limit that braking uses
_ARRIVE_PER_S: Final = 3.0  # speed / distance close to the goal
_ARRIVED: Final = 0.002  # distance that counts as at the goal, m and rad
_ARRIVED_SPEED: Final = 0.05  # largest speed at the goal, m/s on each axis and rad/s


@dataclass(frozen=True, kw_only=True)
class Pace:
    """Speed limits of a relative movement."""

    speed_mps: float  # horizontal
    climb_mps: float  # up and down
    yaw_rate_radps: float


class Reference:
    """The point to follow: x, y and z in the world; yaw counter-clockwise and unwrapped.

    The drone gets `acceleration` as feed-forward and follows with the lag of its thrust. Its
    position is therefore controlled to a point with the same lag (`trailing`,
    `trailing_velocity`). Control to the leading point would exceed the limits.
    """

    def __init__(self, profile: Profile) -> None:
        self._profile = profile
        self._gain = lag_gain(profile.thrust_lag_s)
        self.trailing = [0.0, 0.0, 0.0]
        self.trailing_velocity = [0.0, 0.0, 0.0]
        self.position = [0.0, 0.0, 0.0]
        self.velocity = [0.0, 0.0, 0.0]
        self.acceleration = [0.0, 0.0, 0.0]
        self.yaw_rad = 0.0
        self.yaw_rate_radps = 0.0

    def reset(self, pose: Pose) -> None:
        """Place the leading and the trailing point at a pose, at rest."""
        self.settle((pose.x_m, pose.y_m, pose.z_m))
        self.trailing[:] = self.position
        self.trailing_velocity[:] = self.velocity
        self.yaw_rad, self.yaw_rate_radps = pose.yaw_rad, 0.0

    def settle(self, goal: tuple[float, float, float]) -> None:
        """Stop at a goal that has been reached within the tolerance."""
        self.position[:] = goal
        self.velocity[:] = self.acceleration[:] = (0.0, 0.0, 0.0)

    def keep_near(self, drone: Pose, reach_m: float) -> None:
        """Limit the distance, along each axis, from the drone, which may be blocked."""
        for axis, value in enumerate((drone.x_m, drone.y_m, drone.z_m)):
            for point in (self.position, self.trailing):
                point[axis] = max(value - reach_m, min(value + reach_m, point[axis]))

    def trail(self) -> None:
        """Advance the trailing point by one control step."""
        for axis in range(3):
            self.trailing[axis] += self._gain * (self.position[axis] - self.trailing[axis])
            lost = self.velocity[axis] - self.trailing_velocity[axis]
            self.trailing_velocity[axis] += self._gain * lost

    def go_to(self, goal: tuple[float, float, float], pace: Pace) -> bool:
        """Advance by one control step towards a goal in a straight line; return True at it."""
        dx, dy, dz = (goal[axis] - self.position[axis] for axis in range(3))
        flat, distance = math.hypot(dx, dy), math.sqrt(dx * dx + dy * dy + dz * dz)
        if distance < _ARRIVED and max(map(abs, self.velocity)) < _ARRIVED_SPEED:
            self.settle(goal)
            return True
        profile = self._profile
        # Horizontal and vertical limits differ; the motion along the line must keep both.
        limit = acceleration = math.inf
        if flat > 1e-9:
            limit = pace.speed_mps * distance / flat
            acceleration = profile.max_acceleration_mps2 * distance / flat
        if abs(dz) > 1e-9:
            limit = min(limit, pace.climb_mps * distance / abs(dz))
            rise = profile.max_climb_acceleration_mps2 * distance / abs(dz)
            acceleration = min(acceleration, rise)
        share = _arrival_speed(distance, limit, acceleration) / distance if distance else 0.0
        self.steer(dx * share, dy * share, dz * share)
        return False

    def steer(self, vx_mps: float, vy_mps: float, vz_mps: float) -> None:
        """Advance by one control step, changing the velocity towards a wanted one, world axes."""
        profile, velocity = self._profile, self.velocity
        ex, ey = vx_mps - velocity[0], vy_mps - velocity[1]
        error = math.hypot(ex, ey)
        reach = profile.max_acceleration_mps2 * CONTROL_STEP_S
        share = min(1.0, reach / error) if error else 0.0
        climb_reach = profile.max_climb_acceleration_mps2 * CONTROL_STEP_S
        rise = velocity[2] + clamp(vz_mps - velocity[2], climb_reach)
        change = (ex * share, ey * share, rise - velocity[2])
        for axis in range(3):
            velocity[axis] += change[axis]
            self.acceleration[axis] = change[axis] / CONTROL_STEP_S
            self.position[axis] += velocity[axis] * CONTROL_STEP_S

    def turn_to(self, yaw_rad: float, pace: Pace) -> bool:
        """Turn for one control step towards a heading, unwrapped; return True at the heading."""
        error = yaw_rad - self.yaw_rad
        if abs(error) < _ARRIVED and abs(self.yaw_rate_radps) < _ARRIVED_SPEED:
            self.yaw_rad, self.yaw_rate_radps = yaw_rad, 0.0
            return True
        acceleration = self._profile.max_yaw_acceleration_radps2
        rate = _arrival_speed(abs(error), pace.yaw_rate_radps, acceleration)
        self.spin(math.copysign(rate, error))
        return False

    def spin(self, rate_radps: float) -> None:
        """Turn for one control step, changing the yaw rate towards a wanted one."""
        reach = self._profile.max_yaw_acceleration_radps2 * CONTROL_STEP_S
        self.yaw_rate_radps += clamp(rate_radps - self.yaw_rate_radps, reach)
        self.yaw_rad += self.yaw_rate_radps * CONTROL_STEP_S

    def yaw_error(self, yaw_rad: float) -> float:
        """Return the shortest turn from a wrapped heading to the reference's heading, rad."""
        return wrap_angle(self.yaw_rad - yaw_rad)


def _arrival_speed(distance: float, limit: float, acceleration: float) -> float:
    """Return the speed at a distance from the goal, within a speed limit."""
    braking = math.sqrt(2.0 * _BRAKE_SHARE * acceleration * distance)
    return min(limit, braking, _ARRIVE_PER_S * distance)
