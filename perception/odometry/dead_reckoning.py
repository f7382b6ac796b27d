"""Dead reckoning: the drone's own velocity and yaw, integrated into poses."""

from __future__ import annotations

import bisect
import math
from dataclasses import dataclass

from uav_bt.types import BodyVelocity, DroneState

__all__ = ["Odometry", "OdometryPose"]


@dataclass(frozen=True)
class OdometryPose:
    """A dead-reckoned pose: origin where the odometry began, x along yaw 0, y to its right."""

    time_s: float
    x_m: float
    y_m: float
    yaw_rad: float  # clockwise positive, as the drone reports it

    def to_world(self, forward_m: float, right_m: float) -> tuple[float, float]:
        """Place a point given relative to this pose into the odometry frame."""
        c, s = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        return (
            self.x_m + c * forward_m - s * right_m,
            self.y_m + s * forward_m + c * right_m,
        )

    def to_body(self, x_m: float, y_m: float) -> tuple[float, float]:
        """Return a point of the odometry frame as (forward, right) from this pose."""
        c, s = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        dx, dy = x_m - self.x_m, y_m - self.y_m
        return c * dx + s * dy, -s * dx + c * dy


class Odometry:
    """Integrates telemetry into poses and remembers the last few seconds of them."""

    def __init__(self, memory_s: float = 3.0) -> None:
        self._memory_s = memory_s
        self._poses: list[OdometryPose] = []
        self._velocity = BodyVelocity()  # of the newest pose

    def update(self, state: DroneState) -> OdometryPose:
        """Add a telemetry sample and return the newest pose.

        A sample that is not newer, or has a velocity or yaw that is not finite, changes nothing.
        """
        yaw_rad, velocity = state.attitude.yaw_rad, state.velocity
        numbers = (state.captured_s, yaw_rad, velocity.forward_mps, velocity.right_mps)
        if not all(map(math.isfinite, numbers)):
            return self.now or OdometryPose(state.captured_s, 0.0, 0.0, 0.0)
        if not self._poses:
            self._velocity = velocity
            self._poses.append(OdometryPose(state.captured_s, 0.0, 0.0, yaw_rad))
            return self._poses[-1]
        last = self._poses[-1]
        dt = state.captured_s - last.time_s
        if dt <= 0.0:
            return last
        # Half-way between the samples: a turn of 10 degrees a tick would bend the path otherwise.
        turn_rad = math.remainder(yaw_rad - last.yaw_rad, 2.0 * math.pi)
        between = OdometryPose(last.time_s, last.x_m, last.y_m, last.yaw_rad + turn_rad / 2.0)
        x_m, y_m = between.to_world(
            (self._velocity.forward_mps + velocity.forward_mps) / 2.0 * dt,
            (self._velocity.right_mps + velocity.right_mps) / 2.0 * dt,
        )
        self._velocity = velocity
        self._poses.append(OdometryPose(state.captured_s, x_m, y_m, yaw_rad))
        while self._poses[0].time_s < state.captured_s - self._memory_s:
            self._poses.pop(0)
        return self._poses[-1]

    @property
    def now(self) -> OdometryPose | None:
        """The newest pose, None before the first sample."""
        return self._poses[-1] if self._poses else None

    def at(self, time_s: float) -> OdometryPose | None:
        """Return the pose of a moment, interpolated; the oldest known when it is further back."""
        if not self._poses:
            return None
        index = bisect.bisect_left([pose.time_s for pose in self._poses], time_s)
        if index == 0:
            return self._poses[0]
        if index == len(self._poses):
            return self._poses[-1]
        before, after = self._poses[index - 1], self._poses[index]
        share = (time_s - before.time_s) / (after.time_s - before.time_s)
        turn = math.remainder(after.yaw_rad - before.yaw_rad, 2.0 * math.pi)
        return OdometryPose(
            time_s,
            before.x_m + share * (after.x_m - before.x_m),
            before.y_m + share * (after.y_m - before.y_m),
            before.yaw_rad + share * turn,
        )
