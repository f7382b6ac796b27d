"""One relative movement: proposed until the drone reports its end, resumed when it ended early.

An override (a stale frame, a lost link, a pilot) makes the drone hover, and the drone reports the
movement as interrupted. No leaf knows of overrides, and none has to: what is left of the movement
is measured with the telemetry and proposed again.
"""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass

from uav_bt.board.context import Proposals
from uav_bt.types import DroneState, MoveBy, MovementState
from uav_bt.types.dead_reckoning import Odometry


@dataclass(frozen=True, kw_only=True)
class MovementConfig:
    """When a movement has failed, and how one that ended early is resumed."""

    # A movement whose end is not reported has ended after the time that the slowest drone takes.
    min_speed_mps: float = 0.1
    min_yaw_rate_radps: float = 0.2
    grace_s: float = 4.0  # besides: for the command's latency, acceleration and settling
    near_m: float = 0.03  # what is left below this and the angle is not worth another movement
    near_rad: float = math.radians(3)
    retry_s: float = 1.0  # from one attempt that led nowhere to the next
    retries: int = 4  # so many more, each without progress, before the movement has failed


class Progress(enum.Enum):
    """How the movement in hand is doing."""

    IDLE = "idle"  # there is none
    RUNNING = "running"  # it was proposed again, or will be after a moment's hovering
    DONE = "done"
    INTERRUPTED = "interrupted"  # it ended early, and what is left is unknown or not wanted
    FAILED = "failed"  # interrupted, rejected or not acknowledged again and again


@dataclass(frozen=True, kw_only=True)
class Displacement:
    """A relative movement in the body frame of its begin."""

    forward_m: float = 0.0  # negative is backward
    right_m: float = 0.0
    down_m: float = 0.0  # negative climbs
    yaw_rad: float = 0.0  # clockwise positive

    @property
    def length_m(self) -> float:
        """The metres, added up."""
        return abs(self.forward_m) + abs(self.right_m) + abs(self.down_m)


class _Way:
    """Measures with the telemetry how much of a displacement is left to be flown."""

    def __init__(self, wanted: Displacement, state: DroneState) -> None:
        self._odometry = Odometry()
        begin = self._odometry.update(state)
        self._level = wanted.forward_m != 0.0 or wanted.right_m != 0.0
        self._goal = begin.to_world(wanted.forward_m, wanted.right_m)
        self._down_m, self._altitude_m = wanted.down_m, state.altitude_m
        # Counted, not compared: a turn may be longer than half a circle.
        self._yaw_left_rad, self._yaw_rad = wanted.yaw_rad, begin.yaw_rad
        self._turns = wanted.yaw_rad != 0.0
        self._lost = False

    def follow(self, state: DroneState) -> None:
        """Add a telemetry sample."""
        yaw_rad = self._odometry.update(state).yaw_rad
        self._yaw_left_rad -= math.remainder(yaw_rad - self._yaw_rad, 2.0 * math.pi)
        self._yaw_rad = yaw_rad
        climbed_m = state.altitude_m - self._altitude_m
        if self._down_m != 0.0 and math.isfinite(climbed_m):
            self._down_m += climbed_m
            self._altitude_m = state.altitude_m

    def pause(self) -> None:
        """Note that the drone was not followed for a while: heading and altitude are still known.

        Where it was flown meanwhile is not, and a step goes on from a known place only.
        """
        self._lost = self._level

    def left(self) -> Displacement | None:
        """Return what is left, in the body frame of now; None when it is not known."""
        pose = self._odometry.now
        if self._lost or pose is None:
            return None
        forward_m, right_m = pose.to_body(*self._goal) if self._level else (0.0, 0.0)
        return Displacement(
            forward_m=forward_m,
            right_m=right_m,
            down_m=self._down_m,
            yaw_rad=self._yaw_left_rad if self._turns else 0.0,
        )


class StepInHand:
    """Holds the `MoveBy` in progress.

    The owner starts one, calls `update` every tick, and proposes what `proposal` gives. Nothing is
    commanded from here: a halted leaf stops proposing, and the arbiter cancels the movement.

    Args:
        proposals: numbers the movements.
        config: when a movement counts as failed.
        resumes: whether a movement that ended early goes on; otherwise it has ended.
    """

    def __init__(
        self, proposals: Proposals, config: MovementConfig | None = None, *, resumes: bool = True
    ) -> None:
        self._proposals = proposals
        self._config = config or MovementConfig()
        self._resumes = resumes
        self.proposal: MoveBy | None = None  # None, too, between two attempts
        self.ended_s = -math.inf  # when the last movement ended: frames before it show the old view
        self.trouble = ""  # why the last movement failed
        self._way: _Way | None = None  # None without a movement
        self._deadline_s = self._retry_s = math.inf
        self._begin_count()

    @property
    def busy(self) -> bool:
        """True while a movement is in progress."""
        return self._way is not None

    def start(
        self,
        state: DroneState,
        now_s: float,
        *,
        forward_m: float = 0.0,
        right_m: float = 0.0,
        down_m: float = 0.0,
        yaw_rad: float = 0.0,
    ) -> MoveBy:
        """Start a movement, in place of the one in progress, and return it.

        Args:
            state: the drone's newest telemetry.
            now_s: the mission clock's time.
            forward_m: in the body frame of now; negative is backward.
            right_m: in the body frame of now.
            down_m: negative climbs.
            yaw_rad: clockwise positive.
        """
        wanted = Displacement(forward_m=forward_m, right_m=right_m, down_m=down_m, yaw_rad=yaw_rad)
        self._way = _Way(wanted, state)
        self._begin_count()
        return self._attempt(wanted, now_s)

    def update(self, state: DroneState, now_s: float) -> Progress:
        """Return how the movement is doing, which is dropped when it has ended.

        Args:
            state: the drone's newest telemetry.
            now_s: the mission clock's time.
        """
        if self._way is None:
            return Progress.IDLE
        self._way.follow(state)
        if self.proposal is None:
            return self._retry(now_s)
        status, word = state.movement, None
        if status is not None and status.id == self.proposal.id:
            word = status.state
        if word is MovementState.DONE:
            return self._end(state.captured_s, Progress.DONE)
        if word in {MovementState.INTERRUPTED, MovementState.REJECTED}:
            return self._ended_early(word.value, state.captured_s, now_s)
        if now_s > self._deadline_s:
            return self._ended_early("not done in time", now_s, now_s)
        return Progress.RUNNING

    def pause(self, duration_s: float) -> None:
        """Note that nobody followed the movement for a while, because a person flew.

        Args:
            duration_s: how long.
        """
        if self._way is not None:
            self._deadline_s += duration_s
            self._way.pause()
            self._begin_count()

    def drop(self, now_s: float) -> None:
        """Forget the movement: its owner was halted or changed its mind."""
        if self._way is not None:
            self._end(now_s, Progress.IDLE)

    def _begin_count(self) -> None:
        self._failures, self._least = 0, math.inf  # attempts without progress; least that was left

    def _attempt(self, wanted: Displacement, now_s: float) -> MoveBy:
        self.proposal = MoveBy(
            id=self._proposals.next_id(),
            forward_m=wanted.forward_m,
            right_m=wanted.right_m,
            down_m=wanted.down_m,
            yaw_rad=wanted.yaw_rad,
        )
        cfg = self._config
        self._deadline_s = (
            now_s
            + wanted.length_m / cfg.min_speed_mps
            + abs(wanted.yaw_rad) / cfg.min_yaw_rate_radps
            + cfg.grace_s
        )
        return self.proposal

    def _retry(self, now_s: float) -> Progress:
        left = None if self._way is None else self._way.left()
        if left is None:
            return self._end(now_s, Progress.INTERRUPTED)
        if now_s >= self._retry_s:
            self._attempt(left, now_s)
        return Progress.RUNNING

    def _ended_early(self, how: str, ended_s: float, now_s: float) -> Progress:
        """Resume a movement, or give it up."""
        cfg = self._config
        left = self._way.left() if self._way is not None and self._resumes else None
        if left is None:
            return self._end(ended_s, Progress.INTERRUPTED)
        if left.length_m < cfg.near_m and abs(left.yaw_rad) < cfg.near_rad:
            return self._end(ended_s, Progress.DONE)
        amount = left.length_m / cfg.near_m + abs(left.yaw_rad) / cfg.near_rad
        if amount > self._least - 1.0:
            self._failures += 1
        else:
            self._failures, self._least = 0, amount
        if self._failures > cfg.retries:
            self.trouble = (
                f"movement {how} {self._failures + 1} times without progress, {left.length_m:.2f} m"
                f" and {abs(math.degrees(left.yaw_rad)):.0f} deg left"
            )
            return self._end(ended_s, Progress.FAILED)
        self.proposal = None
        self._retry_s = now_s + (cfg.retry_s if self._failures else 0.0)
        return self._retry(now_s)

    def _end(self, time_s: float, how: Progress) -> Progress:
        self.proposal = self._way = None
        self.ended_s = time_s
        return how
