"""Dead reckoning: telemetry's velocity and heading, integrated into poses."""

from __future__ import annotations

import bisect
import math
from dataclasses import dataclass, field, replace
from typing import Final, Generic, TypeVar

from uav_bt.types.drone_state import BodyVelocity, DroneState
from uav_bt.types.pose import Pose2D, wrap_angle

SomePose = TypeVar("SomePose", bound=Pose2D)

# Time for which a velocity or a turn is extrapolated: two periods of 5 Hz telemetry, and delay
CARRY_S: Final = 0.5
TURN_SPAN_S: Final = 0.15  # s between headings for a turning rate; chosen, noise against lag
_TIME_SLACK_S: Final = 1e-6  # s; accuracy of differences of times


class PoseHistory(Generic[SomePose]):
    """The poses of the last seconds, which place a late frame where it was captured."""

    def __init__(self, memory_s: float) -> None:
        self._memory_s = memory_s
        self._times_s: list[float] = []
        self._poses: list[SomePose] = []

    def add(self, time_s: float, pose: SomePose) -> None:
        """Add a pose; times must rise."""
        self._times_s.append(time_s)
        self._poses.append(pose)
        old = bisect.bisect_left(self._times_s, time_s - self._memory_s)
        del self._times_s[:old], self._poses[:old]

    @property
    def newest(self) -> SomePose | None:
        """The latest pose, None before the first."""
        return self._poses[-1] if self._poses else None

    def at(self, time_s: float) -> SomePose | None:
        """Return the pose at a time, interpolated; outside, the first or last; None without any."""
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
    """Pose and motion of the drone over the ground, by telemetry and by the frames."""

    pose: OdometryPose  # now, dead-reckoned and corrected by the ground
    seen: OdometryPose  # at the capture of the newest frame used
    velocity: BodyVelocity  # over the ground: telemetry's newest with `error` added
    error: BodyVelocity  # velocity over the ground minus telemetry's; it varies slowly
    # Capture time of the last frame whose ground was followed; -inf before the first
    tracked_s: float
    turn_rad: float = 0.0  # heading minus telemetry's; it varies slowly
    velocity_s: float | None = None  # capture time of `velocity`; None for the time of the pose
    # The part of `error` that turns with the drone
    bias: BodyVelocity = field(default_factory=BodyVelocity)
    # Displacement over the ground by the frames over that of telemetry. It is the factor by which
    # height or focal length are wrong, or telemetry's velocity. None: unknown.
    stretch: float | None = None
    # Share of the image with ground near enough to be followed up to the frame of `seen`, whether
    # it was followed or not. None where no two frames were compared.
    ground_share: float | None = None

    @property
    def drift(self) -> BodyVelocity:
        """The part of `error` that keeps its direction in the world."""
        return BodyVelocity(
            forward_mps=self.error.forward_mps - self.bias.forward_mps,
            right_mps=self.error.right_mps - self.bias.right_mps,
        )

    @property
    def untracked_s(self) -> float:
        """Time since ground was followed, s, flown by telemetry alone; inf before the first."""
        return self.pose.time_s - self.tracked_s

    @property
    def reported_yaw_rad(self) -> float:
        """Telemetry's heading, extrapolated to the time of the pose; clockwise."""
        return wrap_angle(self.pose.yaw_rad - self.turn_rad)

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

    Velocity and heading each count at their capture time. They are interpolated between two
    measurements and extrapolated for `CARRY_S` after the newest, so a frame or a command between
    two reports has a pose. Later the velocity is unknown, and the newest pose stays unchanged.
    In a gap of more than two `CARRY_S` each of the velocities at its ends counts for `CARRY_S`,
    because a drone without telemetry hovers. `unflown_s` is the time of all gaps without velocity.
    """

    def __init__(self, memory_s: float = 3.0) -> None:
        self.unflown_s = 0.0
        self._history: PoseHistory[OdometryPose] = PoseHistory(memory_s)  # at velocity's times
        self._headings = _Headings(memory_s)
        self._velocity = BodyVelocity()
        self._now_s = -math.inf

    @property
    def velocity(self) -> BodyVelocity:
        """The newest velocity of telemetry."""
        return self._velocity

    @property
    def velocity_s(self) -> float:
        """Capture time of that velocity, s; -inf before the first."""
        return -math.inf if self._history.newest is None else self._history.newest.time_s

    def update(self, state: DroneState, now_s: float | None = None) -> OdometryPose:
        """Add telemetry and return the pose at `now_s`, or at the newest of velocity and heading.

        Quantities that are not newer are ignored, and telemetry with a time, velocity or heading
        that is not finite.
        """
        times, velocity, yaw_rad = state.times, state.velocity, state.attitude.yaw_rad
        speeds = (velocity.forward_mps, velocity.right_mps)
        if all(map(math.isfinite, (times.velocity_s, times.attitude_s, yaw_rad, *speeds))):
            self._headings.add(times.attitude_s, yaw_rad)
            if times.velocity_s > self.velocity_s:
                self._integrate(times.velocity_s, velocity)
            newest_s = max(times.velocity_s, times.attitude_s)
            self._now_s = max(self._now_s, newest_s if now_s is None else now_s)
        return self.now or OdometryPose(time_s=state.captured_s, x_m=0.0, y_m=0.0, yaw_rad=0.0)

    def add_heading(self, time_s: float, yaw_rad: float) -> None:
        """Add a heading (clockwise) from a frame, which may be older than telemetry's newest."""
        if math.isfinite(time_s) and math.isfinite(yaw_rad):
            self._headings.add(time_s, yaw_rad)

    def _integrate(self, time_s: float, velocity: BodyVelocity) -> None:
        last, x_m, y_m = self._history.newest, 0.0, 0.0
        if last is not None:
            mean = BodyVelocity(
                forward_mps=(self._velocity.forward_mps + velocity.forward_mps) / 2.0,
                right_mps=(self._velocity.right_mps + velocity.right_mps) / 2.0,
            )
            passed_s = time_s - last.time_s
            flown_s = min(passed_s, 2.0 * CARRY_S)
            self.unflown_s += passed_s - flown_s
            x_m, y_m = self._flown(last, mean, flown_s)
        self._velocity = velocity
        pose = OdometryPose(time_s=time_s, x_m=x_m, y_m=y_m, yaw_rad=self._headings.at(time_s))
        self._history.add(time_s, pose)

    def _flown(
        self, begin: OdometryPose, velocity: BodyVelocity, passed_s: float
    ) -> tuple[float, float]:
        # The heading half-way, because a turn of 10 degrees per tick bends the path.
        yaw_rad = self._headings.at(begin.time_s + passed_s / 2.0)
        return Pose2D(x_m=begin.x_m, y_m=begin.y_m, yaw_rad=yaw_rad).to_world(
            velocity.forward_mps * passed_s, velocity.right_mps * passed_s
        )

    @property
    def now(self) -> OdometryPose | None:
        """The newest pose, None before the first sample."""
        return self.at(math.inf)

    def at(self, time_s: float) -> OdometryPose | None:
        """Return the pose at a time: the oldest before the memory, the newest in the future."""
        oldest, newest = self._history.at(-math.inf), self._history.newest
        if oldest is None or newest is None:
            return None
        latest_s = max(newest.time_s, min(self._now_s, newest.time_s + CARRY_S))
        at_s = min(max(time_s, oldest.time_s), latest_s)
        if at_s <= newest.time_s:
            place = self._history.at(at_s) or newest
            x_m, y_m = place.x_m, place.y_m
        else:
            x_m, y_m = self._flown(newest, self._velocity, at_s - newest.time_s)
        return OdometryPose(time_s=at_s, x_m=x_m, y_m=y_m, yaw_rad=self._headings.at(at_s))


class _Headings:
    """Headings by time, interpolated; after the newest the turn is extrapolated for `CARRY_S`."""

    def __init__(self, memory_s: float) -> None:
        self._memory_s = memory_s
        self._times_s: list[float] = []
        self._yaws_rad: list[float] = []  # unwrapped

    def add(self, time_s: float, yaw_rad: float) -> None:
        """Add a heading; a second one at the same time is ignored."""
        times_s, place = self._times_s, bisect.bisect_left(self._times_s, time_s)
        if place < len(times_s) and times_s[place] == time_s:
            return
        if times_s:
            near_rad = self._yaws_rad[max(0, place - 1)]
            yaw_rad = near_rad + math.remainder(yaw_rad - near_rad, 2.0 * math.pi)
        times_s.insert(place, time_s)
        self._yaws_rad.insert(place, yaw_rad)
        old = bisect.bisect_left(times_s, times_s[-1] - self._memory_s)
        del times_s[:old], self._yaws_rad[:old]

    def at(self, time_s: float) -> float:
        """Return the heading at a time; at least one heading must have been added."""
        times_s, yaws_rad = self._times_s, self._yaws_rad
        after = bisect.bisect_left(times_s, time_s)
        if after == 0:
            return yaws_rad[0]
        if after < len(times_s):
            share = (time_s - times_s[after - 1]) / (times_s[after] - times_s[after - 1])
            return yaws_rad[after - 1] + share * (yaws_rad[after] - yaws_rad[after - 1])
        begin = bisect.bisect_right(times_s, times_s[-1] - TURN_SPAN_S + _TIME_SLACK_S) - 1
        passed_s = times_s[-1] - times_s[max(0, begin)]
        if begin < 0 or passed_s > CARRY_S:
            return yaws_rad[-1]
        turn_radps = (yaws_rad[-1] - yaws_rad[begin]) / passed_s
        return yaws_rad[-1] + turn_radps * min(time_s - times_s[-1], CARRY_S)
