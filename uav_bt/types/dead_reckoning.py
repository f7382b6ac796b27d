"""Dead reckoning: the drone's own velocity and yaw, integrated into poses."""

from __future__ import annotations

import bisect
import math
from dataclasses import dataclass, replace
from typing import Generic, TypeVar

from uav_bt.types.pose import Pose2D, wrap_angle
from uav_bt.types.telemetry import BodyVelocity, DroneState

SomePose = TypeVar("SomePose", bound=Pose2D)


class PoseHistory(Generic[SomePose]):
    """The poses of the last seconds, so that a late frame is placed where it was captured.

    Args:
        memory_s: how long poses are kept.
    """

    def __init__(self, memory_s: float) -> None:
        self._memory_s = memory_s
        self._times_s: list[float] = []
        self._poses: list[SomePose] = []

    def add(self, time_s: float, pose: SomePose) -> None:
        """Note a pose; times rise."""
        self._times_s.append(time_s)
        self._poses.append(pose)
        old = bisect.bisect_left(self._times_s, time_s - self._memory_s)
        del self._times_s[:old], self._poses[:old]

    @property
    def newest(self) -> SomePose | None:
        """The latest pose, None before the first."""
        return self._poses[-1] if self._poses else None

    def at(self, time_s: float) -> SomePose | None:
        """Return the pose of a moment, interpolated; outside, the outermost; None before any."""
        if not self._poses:
            return None
        after = bisect.bisect_left(self._times_s, time_s)
        if after == 0:
            return self._poses[0]
        if after == len(self._poses):
            return self._poses[-1]
        begin_s, end_s = self._times_s[after - 1], self._times_s[after]
        share = (time_s - begin_s) / (end_s - begin_s)
        return self._poses[after - 1].towards(self._poses[after], share)


@dataclass(frozen=True, kw_only=True)
class OdometryPose(Pose2D):
    """A dead-reckoned pose: origin where the odometry began, x along yaw 0, y to its right."""

    time_s: float


@dataclass(frozen=True, kw_only=True)
class MotionEstimate:
    """Where the drone is and how it moves over the ground, by telemetry and by what it saw of it.

    Attributes:
        pose: now, dead-reckoned and corrected by the ground.
        seen: at the capture of the newest frame that went in.
        velocity: over the ground, now: telemetry's with `error` added.
        error: what the ground shows beyond telemetry's velocity, slowly varying.
        tracked_s: capture time of the last frame whose ground was followed; -inf before the first.
        turn_rad: the heading less telemetry's, slowly varying.
    """

    pose: OdometryPose
    seen: OdometryPose
    velocity: BodyVelocity
    error: BodyVelocity
    tracked_s: float
    turn_rad: float = 0.0

    @property
    def untracked_s(self) -> float:
        """For how long telemetry alone has been flown by; inf before ground was followed."""
        return self.pose.time_s - self.tracked_s

    def over_ground(self, state: DroneState) -> DroneState:
        """Return telemetry with the velocity over the ground and the corrected heading."""
        reported = state.velocity
        velocity = BodyVelocity(
            forward_mps=reported.forward_mps + self.error.forward_mps,
            right_mps=reported.right_mps + self.error.right_mps,
            down_mps=reported.down_mps + self.error.down_mps,
        )
        yaw_rad = wrap_angle(state.attitude.yaw_rad + self.turn_rad)
        attitude = replace(state.attitude, yaw_rad=yaw_rad)
        return replace(state, velocity=velocity, attitude=attitude)


class Odometry:
    """Integrates telemetry into poses and remembers the last few seconds of them.

    Args:
        memory_s: how long poses are kept.
    """

    def __init__(self, memory_s: float = 3.0) -> None:
        self._history: PoseHistory[OdometryPose] = PoseHistory(memory_s)
        self._velocity = BodyVelocity()  # of the newest pose

    @property
    def velocity(self) -> BodyVelocity:
        """Telemetry's, of the newest pose."""
        return self._velocity

    def update(self, state: DroneState) -> OdometryPose:
        """Add a telemetry sample and return the newest pose.

        A sample that is not newer, or has a velocity or yaw that is not finite, changes nothing.
        """
        yaw_rad, velocity, last = state.attitude.yaw_rad, state.velocity, self.now
        numbers = (state.captured_s, yaw_rad, velocity.forward_mps, velocity.right_mps)
        if not all(map(math.isfinite, numbers)):
            return last or OdometryPose(time_s=state.captured_s, x_m=0.0, y_m=0.0, yaw_rad=0.0)
        x_m = y_m = 0.0
        if last is not None:
            dt = state.captured_s - last.time_s
            if dt <= 0.0:
                return last
            # Half-way between the samples: a turn of 10 degrees a tick would bend the path.
            turn_rad = math.remainder(yaw_rad - last.yaw_rad, 2.0 * math.pi)
            x_m, y_m = replace(last, yaw_rad=last.yaw_rad + turn_rad / 2.0).to_world(
                (self._velocity.forward_mps + velocity.forward_mps) / 2.0 * dt,
                (self._velocity.right_mps + velocity.right_mps) / 2.0 * dt,
            )
        self._velocity = velocity
        pose = OdometryPose(time_s=state.captured_s, x_m=x_m, y_m=y_m, yaw_rad=yaw_rad)
        self._history.add(pose.time_s, pose)
        return pose

    @property
    def now(self) -> OdometryPose | None:
        """The newest pose, None before the first sample."""
        return self._history.newest

    def at(self, time_s: float) -> OdometryPose | None:
        """Return the pose of a moment, interpolated; the oldest known when it is further back."""
        oldest, pose, newest = self._history.at(-math.inf), self._history.at(time_s), self.now
        if oldest is None or pose is None or newest is None:
            return None
        return replace(pose, time_s=min(max(time_s, oldest.time_s), newest.time_s))
