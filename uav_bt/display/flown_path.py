"""Path of a flight until now, and what films and views show of a tick."""

from __future__ import annotations

import math
from dataclasses import dataclass

from uav_bt.board import CLASS_MAP, CORRIDOR, ELAPSED, MARK, METRIC_DEPTH, SITE_MAP
from uav_bt.board.blackboard import Blackboard, Reading
from uav_bt.mission.tick import TickRecord
from uav_bt.types import (
    ClassMap,
    Corridor,
    DepthMap,
    Frame,
    MarkFix,
    MoverState,
    Pose,
    SiteMap,
)
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
        first = self._first = self._first or now
        forward_m, right_m = first.to_body(now.x_m, now.y_m)
        # The drone's yaw is clockwise, the world's counter-clockwise.
        yaw_rad = first.yaw_rad - now.yaw_rad
        return Pose(x_m=forward_m, y_m=-right_m, z_m=state.height_above_ground_m, yaw_rad=yaw_rad)


@dataclass(frozen=True, kw_only=True)
class Shown:
    """What is shown of a tick; values of the board are None when they are stale."""

    record: TickRecord
    flown: FlownPath
    elapsed_s: float  # since the take-off command
    fix: Reading[MarkFix]
    class_map: ClassMap | None
    depth: Reading[DepthMap]  # metric
    corridor: Corridor | None
    site_map: SiteMap | None

    @classmethod
    def of(cls, record: TickRecord, flown: FlownPath, board: Blackboard) -> Shown:
        """Return what is to be shown of a tick, from the board after it."""
        return cls(
            record=record,
            flown=flown,
            elapsed_s=board.read(ELAPSED).value or 0.0,
            fix=board.read(MARK),
            class_map=board.read(CLASS_MAP).value,
            depth=board.read(METRIC_DEPTH),
            corridor=board.read(CORRIDOR).value,
            site_map=board.read(SITE_MAP).value,
        )

    @property
    def frame(self) -> Frame | None:
        """The newest frame."""
        return self.record.observation.frame
