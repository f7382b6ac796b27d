"""Where the drone has been: from the referee's pose, or by dead reckoning where there is none."""

from __future__ import annotations

import math
from dataclasses import dataclass

from uav_bt.mission.runner import TickRecord
from uav_bt.types import Pose

__all__ = ["FlownPath", "PathPoint"]


@dataclass(frozen=True, kw_only=True)
class PathPoint:
    """A point of a flown path."""

    x_m: float  # world
    y_m: float
    phase: str = ""  # what the mission was doing


class FlownPath:
    """Follows a flight and knows its pose, its path and the distance travelled.

    Without a referee the world is what the telemetry adds up to: its origin is the place of the
    first tick, x points where the drone looked then.
    """

    def __init__(self) -> None:
        self.points: list[PathPoint] = []
        self.distance_m = 0.0
        self.pose: Pose | None = None  # None before the first tick
        self._time_s = 0.0
        self._first_yaw_rad = 0.0

    def add(self, record: TickRecord) -> Pose:
        """Take note of a tick and return the pose of now."""
        truth = record.truth
        pose = truth.pose if truth is not None else self._reckoned(record)
        if self.pose is not None:
            self.distance_m += math.hypot(pose.x_m - self.pose.x_m, pose.y_m - self.pose.y_m)
        self.pose, self._time_s = pose, record.time_s
        self.points.append(PathPoint(x_m=pose.x_m, y_m=pose.y_m, phase=record.phase))
        return pose

    def _reckoned(self, record: TickRecord) -> Pose:
        state = record.observation.state
        before = self.pose
        if before is None:
            self._first_yaw_rad = state.attitude.yaw_rad
            return Pose(x_m=0.0, y_m=0.0, z_m=state.height_above_carpet_m, yaw_rad=0.0)
        # The drone's yaw is clockwise, the world's counter-clockwise.
        yaw_rad = self._first_yaw_rad - state.attitude.yaw_rad
        dt = record.time_s - self._time_s
        forward_m, left_m = state.velocity.forward_mps * dt, -state.velocity.right_mps * dt
        c, s = math.cos(yaw_rad), math.sin(yaw_rad)
        return Pose(
            x_m=before.x_m + c * forward_m - s * left_m,
            y_m=before.y_m + s * forward_m + c * left_m,
            z_m=state.height_above_carpet_m,
            yaw_rad=yaw_rad,
        )
