"""One relative movement: proposed until the drone reports its end, resumed when it ended early.

An override (a stale frame, a lost link, a pilot) makes the drone hover, and the drone reports the
movement as interrupted. Leaves need no code for overrides: the rest of the movement is measured
with the telemetry and proposed again.
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
    """When a movement counts as failed, and how one that ended early is resumed."""

    # A movement times out after the time that a drone with these speeds takes, plus `grace_s`.
    min_speed_mps: float = 0.1
    min_yaw_rate_radps: float = 0.2
    grace_s: float = 4.0  # allowance for the command's latency, acceleration and settling
    near_m: float = 0.03  # a rest smaller than this and `near_rad` counts as done
    near_rad: float = math.radians(3)
    retry_s: float = 1.0  # pause after an attempt without progress
    retries: int = 4  # further attempts without progress before the movement fails


class Progress(enum.Enum):
    """State of the movement in progress."""

    IDLE = "idle"  # without a movement
    RUNNING = "running"  # proposed in this tick, or again after a pause
    DONE = "done"
    INTERRUPTED = "interrupted"  # ended early; the rest is unknown, or not resumed
    FAILED = "failed"  # repeatedly interrupted, rejected or not acknowledged


@dataclass(frozen=True, kw_only=True)
class Displacement:
    """A relative movement in the body frame at its start."""

    forward_m: float = 0.0  # negative is backward
    right_m: float = 0.0
    down_m: float = 0.0  # negative climbs
    yaw_rad: float = 0.0  # clockwise positive

    @property
    def length_m(self) -> float:
        """The sum of the distances along the three axes, metres."""
        return abs(self.forward_m) + abs(self.right_m) + abs(self.down_m)


class _Way:
    """The rest of a displacement, measured with the telemetry."""

    def __init__(self, wanted: Displacement, state: DroneState, now_s: float) -> None:
        self._odometry = Odometry()
        begin = self._odometry.update(state, now_s)
        self._level = wanted.forward_m != 0.0 or wanted.right_m != 0.0
        self._goal = begin.to_world(wanted.forward_m, wanted.right_m)
        self._down_m, self._altitude_m = wanted.down_m, state.altitude_m
        # Turned angles are summed: a turn may be longer than half a circle.
        self._yaw_left_rad, self._yaw_rad = wanted.yaw_rad, begin.yaw_rad
        self._turns = wanted.yaw_rad != 0.0
        self._lost = False

    def follow(self, state: DroneState, now_s: float) -> None:
        """Integrate telemetry, extrapolated to now."""
        yaw_rad = self._odometry.update(state, now_s).yaw_rad
        self._yaw_left_rad -= math.remainder(yaw_rad - self._yaw_rad, 2.0 * math.pi)
        self._yaw_rad = yaw_rad
        climbed_m = state.altitude_m - self._altitude_m
        if self._down_m != 0.0 and math.isfinite(climbed_m):
            self._down_m += climbed_m
            self._altitude_m = state.altitude_m

    def pause(self) -> None:
        """Note that the drone was not tracked for a while.

        Heading and altitude are still known. The position is not, so a step cannot be resumed.
        """
        self._lost = self._level

    def left(self) -> Displacement | None:
        """Return the rest, in the present body frame; None when it is unknown."""
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
    """The `MoveBy` in progress.

    The owner starts one, calls `update` in every tick, and proposes `proposal`. This class commands
    nothing: a halted leaf stops proposing, and the arbiter cancels the movement.

    Args:
        proposals: Source of the movements' numbers.
        config: When a movement counts as failed.
        resumes: Whether a movement that ended early is resumed.
    """

    def __init__(
        self, proposals: Proposals, config: MovementConfig | None = None, *, resumes: bool = True
    ) -> None:
        self._proposals = proposals
        self._config = config or MovementConfig()
        self._resumes = resumes
        self.proposal: MoveBy | None = None  # also None between two attempts
        self.ended_s = -math.inf  # end of the last movement; earlier frames show the old view
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
        """Start a movement, instead of the one in progress, and return it.

        Args:
            state: The drone's newest telemetry.
            now_s: Time of the mission clock.
            forward_m: Distance ahead in the present body frame; negative is backward.
            right_m: Distance to the right in the present body frame.
            down_m: Distance down; negative climbs.
            yaw_rad: clockwise positive.
        """
        wanted = Displacement(forward_m=forward_m, right_m=right_m, down_m=down_m, yaw_rad=yaw_rad)
        self._way = _Way(wanted, state, now_s)
        self._begin_count()
        return self._attempt(wanted, now_s)

    def update(self, state: DroneState, now_s: float) -> Progress:
        """Return the state of the movement, and drop the movement when it has ended.

        Args:
            state: The drone's newest telemetry.
            now_s: Time of the mission clock.
        """
        if self._way is None:
            return Progress.IDLE
        self._way.follow(state, now_s)
        if self.proposal is None:
            return self._retry(now_s)
        status, word = state.movement, None
        if status is not None and status.id == self.proposal.id:
            word = status.state
        if word is MovementState.DONE:
            return self._end(now_s, Progress.DONE)
        if word in {MovementState.INTERRUPTED, MovementState.REJECTED}:
            return self._ended_early(word.value, now_s)
        if now_s > self._deadline_s:
            return self._ended_early("not done in time", now_s)
        return Progress.RUNNING

    def pause(self, duration_s: float) -> None:
        """Note that the movement was not tracked for a while, because a person flew.

        Args:
            duration_s: Duration of the pause.
        """
        if self._way is not None:
            self._deadline_s += duration_s
            self._way.pause()
            self._begin_count()

    def drop(self, now_s: float) -> None:
        """Drop the movement: its owner was halted or has decided anew."""
        if self._way is not None:
            self._end(now_s, Progress.IDLE)

    def _begin_count(self) -> None:
        self._failures, self._least = 0, math.inf  # attempts without progress; smallest rest

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

    def _ended_early(self, how: str, now_s: float) -> Progress:
        """Resume the movement, or end it."""
        cfg = self._config
        left = self._way.left() if self._way is not None and self._resumes else None
        if left is None:
            return self._end(now_s, Progress.INTERRUPTED)
        if left.length_m < cfg.near_m and abs(left.yaw_rad) < cfg.near_rad:
            return self._end(now_s, Progress.DONE)
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
            return self._end(now_s, Progress.FAILED)
        self.proposal = None
        self._retry_s = now_s + (cfg.retry_s if self._failures else 0.0)
        return self._retry(now_s)

    def _end(self, time_s: float, how: Progress) -> Progress:
        self.proposal = self._way = None
        self.ended_s = time_s
        return how
