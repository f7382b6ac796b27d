"""Path of a flight until now."""

from __future__ import annotations

import math
from dataclasses import dataclass

from uav_bt.mission.tick import TickRecord
from uav_bt.types import MoverState, Pose
from uav_bt.types.dead_reckoning import Odometry, OdometryPose


@dataclass(frozen=True, kw_only=True)
class PathPoint:
    """A point of a flown path."""

    x_m: float  # world x
    y_m: float
    phase: str = ""  # phase of the mission


class FlownPath:
    """Tracks the pose, the path and the travelled distance of a flight.

    Without a referee the pose is dead-reckoned from the telemetry. The origin is then the position
    at the first tick, and x points along the heading at that tick.
    """

    def __init__(self) -> None:
        self.points: list[PathPoint] = []
        self.phases: list[str] = []  # in the order of their first appearance
        self.distance_m = 0.0
        self.pose: Pose | None = None  # None before the first tick
        self.movers: tuple[MoverState, ...] = ()  # ground truth
        self._odometry = Odometry()
        self._first: OdometryPose | None = None

    def add(self, record: TickRecord) -> Pose:
        """Add a tick and return the present pose."""
        truth = record.truth
        self.movers = () if truth is None else truth.movers
        pose = truth.pose if truth is not None else self._reckoned(record)
        if self.pose is not None:
            self.distance_m += math.hypot(pose.x_m - self.pose.x_m, pose.y_m - self.pose.y_m)
        self.pose = pose
        self.points.append(PathPoint(x_m=pose.x_m, y_m=pose.y_m, phase=record.phase))
        if record.phase not in self.phases:
            self.phases.append(record.phase)
        return pose

    def _reckoned(self, record: TickRecord) -> Pose:
        state = record.observation.state
        now = self._odometry.update(state, record.time_s)
        if self._first is None:
            self._first = now
        forward_m, right_m = self._first.to_body(now.x_m, now.y_m)
        # The drone's yaw is clockwise, the world's counter-clockwise.
        return Pose(
            x_m=forward_m,
            y_m=-right_m,
            z_m=state.height_above_ground_m,
            yaw_rad=self._first.yaw_rad - now.yaw_rad,
        )
