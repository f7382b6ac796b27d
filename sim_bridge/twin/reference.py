"""Reference of the autopilot: a moving point within the speed and acceleration limits."""

from __future__ import annotations

import math
from dataclasses import dataclass

from sim_bridge.twin.profile import Profile
from uav_bt.types import wrap_angle
from uav_bt.types.pose import clamp


@dataclass(frozen=True, kw_only=True)
class Pace:
    """Speed limits of a relative movement."""

    speed_mps: float  # horizontal
    climb_mps: float  # up and down
    yaw_rate_radps: float


@dataclass(frozen=True, kw_only=True)
class ReferenceConfig:
    """Braking of the point, and its tolerances at the goal."""

    brake_share: float = 0.7  # share of the acceleration limit that braking uses
    arrive_per_s: float = 3.0  # speed / distance close to the goal
    arrived_m: float = 0.002
    arrived_rad: float = 0.002
    arrived_speed: float = 0.05  # largest speed at the goal, m/s on each axis and rad/s


def _towards(value: float, target: float, step: float) -> float:
    return value + clamp(target - value, step)


class Reference:
    """The point to follow: x, y and z in the world; yaw counter-clockwise and unwrapped.

    The drone gets `acceleration` as feed-forward and follows with the lag of its thrust. Its
    position is therefore controlled to a point with the same lag (`trailing`,
    `trailing_velocity`). Control to the leading point would exceed the limits.

    Args:
        profile: the limits, and the lag of the thrust.
        step_s: time between two calls of `trail`.
        config: braking and tolerances.
    """

    def __init__(
        self, profile: Profile, step_s: float, config: ReferenceConfig | None = None
    ) -> None:
        self._profile = profile
        self._config = config or ReferenceConfig()
        lag = profile.thrust_lag_s
        self._gain = 1.0 - math.exp(-step_s / lag) if lag > 0.0 else 1.0
        self.trailing = [0.0, 0.0, 0.0]
        self.trailing_velocity = [0.0, 0.0, 0.0]
        self.position = [0.0, 0.0, 0.0]
        self.velocity = [0.0, 0.0, 0.0]
        self.acceleration = [0.0, 0.0, 0.0]
        self.yaw_rad = 0.0
        self.yaw_rate_radps = 0.0

    def reset(self, x_m: float, y_m: float, z_m: float, yaw_rad: float) -> None:
        """Place the leading and the trailing point at a pose, at rest.

        Args:
            x_m: world x.
            y_m: world y.
            z_m: world z.
            yaw_rad: heading, counter-clockwise.
        """
        self.position[:] = self.trailing[:] = (x_m, y_m, z_m)
        self.velocity[:] = self.trailing_velocity[:] = (0.0, 0.0, 0.0)
        self.acceleration[:] = (0.0, 0.0, 0.0)
        self.yaw_rad = yaw_rad
        self.yaw_rate_radps = 0.0

    def keep_near(self, x_m: float, y_m: float, z_m: float, reach_m: float) -> None:
        """Limit the distance of the point from the drone, which may be blocked.

        Args:
            x_m: world x of the drone.
            y_m: world y of the drone.
            z_m: world z of the drone.
            reach_m: largest distance along each axis.
        """
        for axis, value in enumerate((x_m, y_m, z_m)):
            low_m, high_m = value - reach_m, value + reach_m
            for point in (self.position, self.trailing):
                if not low_m <= point[axis] <= high_m:
                    point[axis] = max(low_m, min(high_m, point[axis]))

    def trail(self) -> None:
        """Advance the trailing point by one step."""
        for axis in range(3):
            self.trailing[axis] += self._gain * (self.position[axis] - self.trailing[axis])
            lost = self.velocity[axis] - self.trailing_velocity[axis]
            self.trailing_velocity[axis] += self._gain * lost

    def settle(self, goal: tuple[float, float, float]) -> None:
        """Stop at a goal that has been reached within the tolerance."""
        self.position[:] = goal
        self.velocity[:] = (0.0, 0.0, 0.0)
        self.acceleration[:] = (0.0, 0.0, 0.0)

    def go_to(self, goal: tuple[float, float, float], pace: Pace, step_s: float) -> bool:
        """Advance towards a goal in a straight line; return True at the goal.

        Args:
            goal: goal, world x, y and z.
            pace: the speed limits.
            step_s: time to advance by.
        """
        cfg = self._config
        dx, dy, dz = (goal[axis] - self.position[axis] for axis in range(3))
        flat, distance = math.hypot(dx, dy), math.sqrt(dx * dx + dy * dy + dz * dz)
        if distance < cfg.arrived_m and max(map(abs, self.velocity)) < cfg.arrived_speed:
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
        share = self._arrival_speed(distance, limit, acceleration) / distance if distance else 0.0
        self.steer(dx * share, dy * share, dz * share, step_s)
        return False

    def _arrival_speed(self, distance: float, limit: float, acceleration: float) -> float:
        cfg = self._config
        braking = math.sqrt(2.0 * cfg.brake_share * acceleration * distance)
        return min(limit, braking, cfg.arrive_per_s * distance)

    def steer(self, vx_mps: float, vy_mps: float, vz_mps: float, step_s: float) -> None:
        """Advance, changing the velocity towards a wanted one within the acceleration limits.

        Args:
            vx_mps: wanted velocity along world x.
            vy_mps: wanted velocity along world y.
            vz_mps: wanted velocity upwards.
            step_s: time to advance by.
        """
        profile, velocity = self._profile, self.velocity
        ex, ey = vx_mps - velocity[0], vy_mps - velocity[1]
        error = math.hypot(ex, ey)
        reach = profile.max_acceleration_mps2 * step_s
        share = min(1.0, reach / error) if error else 0.0
        rise = _towards(velocity[2], vz_mps, profile.max_climb_acceleration_mps2 * step_s)
        change = (ex * share, ey * share, rise - velocity[2])
        for axis in range(3):
            velocity[axis] += change[axis]
            self.acceleration[axis] = change[axis] / step_s
            self.position[axis] += velocity[axis] * step_s

    def turn_to(self, yaw_rad: float, pace: Pace, step_s: float) -> bool:
        """Turn towards a heading; return True at the heading.

        Args:
            yaw_rad: wanted heading, counter-clockwise, unwrapped (it may exceed a full turn).
            pace: the limit of the yaw rate.
            step_s: time to advance by.
        """
        error, profile, cfg = yaw_rad - self.yaw_rad, self._profile, self._config
        if abs(error) < cfg.arrived_rad and abs(self.yaw_rate_radps) < cfg.arrived_speed:
            self.yaw_rad, self.yaw_rate_radps = yaw_rad, 0.0
            return True
        rate = self._arrival_speed(
            abs(error), pace.yaw_rate_radps, profile.max_yaw_acceleration_radps2
        )
        self.spin(math.copysign(rate, error), step_s)
        return False

    def spin(self, rate_radps: float, step_s: float) -> None:
        """Turn, changing the yaw rate towards a wanted one within the acceleration limit.

        Args:
            rate_radps: wanted yaw rate, counter-clockwise.
            step_s: time to advance by.
        """
        reach = self._profile.max_yaw_acceleration_radps2 * step_s
        self.yaw_rate_radps = _towards(self.yaw_rate_radps, rate_radps, reach)
        self.yaw_rad += self.yaw_rate_radps * step_s

    def yaw_error(self, yaw_rad: float) -> float:
        """Return the shortest turn from a wrapped heading to the reference's heading, rad."""
        return wrap_angle(self.yaw_rad - yaw_rad)
