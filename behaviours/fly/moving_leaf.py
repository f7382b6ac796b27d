"""Base of the leaves that make relative movements, one at a time.

An override (a stale frame, a lost link, a pilot) makes the drone hover, and the drone reports the
movement as interrupted. The rest is measured with the telemetry and proposed again.
"""

from __future__ import annotations

import enum
import math
from abc import abstractmethod
from dataclasses import replace
from typing import ClassVar, Final

from uav_bt.board import STATE
from uav_bt.board.context import MissionContext, Proposals
from uav_bt.errors import MissionError
from uav_bt.protocols import Clock
from uav_bt.tree import Leaf, Status
from uav_bt.types import DroneState, Frame, GimbalTo, MoveBy, MovementState
from uav_bt.types.dead_reckoning import Odometry
from uav_bt.types.flight_results import EventKind

STRAIGHT_DOWN_RAD: Final = -math.pi / 2
_PAUSE_S: Final = 1.0  # a longer time between two ticks is a pause; no tick takes this long
# A movement times out after the time that a drone with these speeds takes, plus `_GRACE_S`.
_MIN_SPEED_MPS: Final = 0.1
_MIN_YAW_RATE_RADPS: Final = 0.2
_GRACE_S: Final = 4.0  # allowance for the command's latency, acceleration and settling
_NEAR_M: Final = 0.03  # a rest smaller than this and `_NEAR_RAD` counts as done
_NEAR_RAD: Final = math.radians(3)
RETRY_S: Final = 1.0  # pause after an attempt without progress
RETRIES: Final = 4  # further attempts without progress before the movement fails


def camera_points_at(
    frame: Frame | None, pitch_rad: float, *, slack_rad: float = math.radians(2)
) -> bool:
    """Return whether a frame was captured with the gimbal at a pitch; False without a frame."""
    return frame is not None and abs(frame.gimbal_pitch_rad - pitch_rad) < slack_rad


class LeafClock:
    """The mission's time without pauses, in which a pilot flew; `tick` comes before `now`."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._paused_s = 0.0
        self._ticked_s: float | None = None  # mission time; None while the leaf does not run
        self.resumed_s = -math.inf  # mission time when the last pause ended

    def now(self) -> float:
        """Return the leaf's time in seconds; only differences are meaningful."""
        return self._clock.now() - self._paused_s

    def tick(self) -> float:
        """Note a tick and return the length of the pause before it, seconds; 0 without a pause."""
        now_s, last_s = self._clock.now(), self._ticked_s
        self._ticked_s = now_s
        if last_s is None or now_s - last_s <= _PAUSE_S + 1e-6:
            return 0.0
        self._paused_s += now_s - last_s
        self.resumed_s = now_s
        return now_s - last_s

    def stop(self) -> None:
        """Note that the leaf has ended: the time until it begins again is not a pause."""
        self._ticked_s = None


class Progress(enum.Enum):
    """State of the movement in progress."""

    IDLE = "idle"  # without a movement
    RUNNING = "running"  # proposed in this tick, or again after a pause
    DONE = "done"
    INTERRUPTED = "interrupted"  # ended early; the rest is unknown, or not resumed
    FAILED = "failed"  # repeatedly interrupted, rejected or not acknowledged


class _Rest:
    """The rest of a movement, measured with the telemetry."""

    def __init__(self, wanted: MoveBy, state: DroneState, now_s: float) -> None:
        self._wanted, self._odometry = wanted, Odometry()
        begin = self._odometry.update(state, now_s)
        self._goal = begin.to_world(wanted.forward_m, wanted.right_m)
        self._down_m, self._altitude_m = wanted.down_m, state.altitude_m
        # Turned angles are summed: a turn may be longer than half a circle.
        self._yaw_left_rad, self._yaw_rad = wanted.yaw_rad, begin.yaw_rad
        self._level = wanted.forward_m != 0.0 or wanted.right_m != 0.0
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
        """Note that a person flew: heading and altitude are still known, the position is not."""
        self._lost = self._level

    def left(self) -> MoveBy | None:
        """Return the rest, in the present body frame; None when it is unknown."""
        pose = self._odometry.now
        if self._lost or pose is None:
            return None
        x_m, y_m = pose.to_body(*self._goal) if self._level else (0.0, 0.0)
        yaw_rad = self._yaw_left_rad if self._wanted.yaw_rad != 0.0 else 0.0
        return MoveBy(id=0, forward_m=x_m, right_m=y_m, down_m=self._down_m, yaw_rad=yaw_rad)


def _length_m(move: MoveBy) -> float:
    """Return the sum of the distances along the three axes."""
    return abs(move.forward_m) + abs(move.right_m) + abs(move.down_m)


class StepInHand:
    """The `MoveBy` in progress. It commands nothing: its owner proposes `proposal` in every tick.

    One that does not resume ends with a movement that ended early, and its owner decides anew.
    """

    def __init__(self, proposals: Proposals, *, resumes: bool = True) -> None:
        self._proposals, self._resumes = proposals, resumes
        self.proposal: MoveBy | None = None  # also None between two attempts
        self.ended_s = -math.inf  # end of the last movement; earlier frames show the old view
        self.trouble = ""  # why the last movement failed
        self._rest: _Rest | None = None  # None without a movement
        self._deadline_s = self._retry_s = math.inf
        self._failures, self._least = 0, math.inf  # attempts without progress; smallest rest

    @property
    def busy(self) -> bool:
        """True while a movement is in progress."""
        return self._rest is not None

    def start(self, wanted: MoveBy, state: DroneState, now_s: float) -> MoveBy:
        """Start a movement, instead of the one in progress, and return it with its number."""
        self._rest = _Rest(wanted, state, now_s)
        self._failures, self._least = 0, math.inf
        return self._attempt(wanted, now_s)

    def update(self, state: DroneState, now_s: float) -> Progress:
        """Return the state of the movement, and drop the movement when it has ended."""
        if self._rest is None:
            return Progress.IDLE
        self._rest.follow(state, now_s)
        if self.proposal is None:
            return self._retry(self._rest.left(), now_s)
        status = state.movement
        word = None if status is None or status.id != self.proposal.id else status.state
        if word is MovementState.DONE:
            return self._end(now_s, Progress.DONE)
        if word in {MovementState.INTERRUPTED, MovementState.REJECTED}:
            return self._ended_early(word.value, self._rest.left(), now_s)
        if now_s > self._deadline_s:
            return self._ended_early("not done in time", self._rest.left(), now_s)
        return Progress.RUNNING

    def pause(self, duration_s: float) -> None:
        """Note that the movement was not tracked for a while, because a person flew."""
        if self._rest is not None:
            self._deadline_s += duration_s
            self._rest.pause()
            self._failures, self._least = 0, math.inf

    def drop(self, now_s: float) -> None:
        """Drop the movement: its owner was halted or has decided anew."""
        if self._rest is not None:
            self._end(now_s, Progress.IDLE)

    def _attempt(self, wanted: MoveBy, now_s: float) -> MoveBy:
        self.proposal = replace(wanted, id=self._proposals.next_id())
        turn_s = abs(wanted.yaw_rad) / _MIN_YAW_RATE_RADPS
        self._deadline_s = now_s + _length_m(wanted) / _MIN_SPEED_MPS + turn_s + _GRACE_S
        return self.proposal

    def _retry(self, left: MoveBy | None, now_s: float) -> Progress:
        if left is None:
            return self._end(now_s, Progress.INTERRUPTED)
        if now_s >= self._retry_s:
            self._attempt(left, now_s)
        return Progress.RUNNING

    def _ended_early(self, how: str, left: MoveBy | None, now_s: float) -> Progress:
        """Resume the movement, or end it."""
        if left is None or not self._resumes:
            return self._end(now_s, Progress.INTERRUPTED)
        left_m, left_rad = _length_m(left), abs(left.yaw_rad)
        if left_m < _NEAR_M and left_rad < _NEAR_RAD:
            return self._end(now_s, Progress.DONE)
        amount = left_m / _NEAR_M + left_rad / _NEAR_RAD
        if amount > self._least - 1.0:
            self._failures += 1
        else:
            self._failures, self._least = 0, amount
        if self._failures > RETRIES:
            rest = f"{left_m:.2f} m and {math.degrees(left_rad):.0f} deg left"
            how = f"movement {how} {self._failures + 1} times"
            self.trouble = f"{how} without progress, {rest}"
            return self._end(now_s, Progress.FAILED)
        self.proposal = None
        self._retry_s = now_s + (RETRY_S if self._failures else 0.0)
        return self._retry(left, now_s)

    def _end(self, time_s: float, how: Progress) -> Progress:
        self.proposal = self._rest = None
        self.ended_s = time_s
        return how


class MovingLeaf(Leaf):
    """Base of the leaves that make relative movements; `work` does the work of one tick.

    A movement that an override or a pilot interrupted is resumed: the heading by the attitude, the
    height by the altimeter, a step by dead reckoning. A step that a pilot interrupted is not,
    because the drone's place is unknown: it ends, and the leaf decides anew.
    """

    moves = True
    resumes: ClassVar[bool] = True  # False: a movement that ends early is not resumed

    def on_setup(self, mission: MissionContext) -> None:
        """Begin without a movement."""
        self._step = StepInHand(mission.proposals, resumes=self.resumes)
        self.progress = Progress.IDLE  # at the last call of `moving`; an end is reported once
        self._newest: DroneState | None = None
        self.leaf_clock = LeafClock(mission.clock)

    def update(self) -> Status:
        """Do the leaf's work while telemetry is fresh, and point the gimbal while it is RUNNING.

        A leaf that has ended does not point it: the next leaf may do so within the same tick.
        """
        reading = self.read(STATE)
        if (state := reading.value) is None:
            status = self.wait(reading.age_s)
        else:
            self._newest = state
            if (paused_s := self.leaf_clock.tick()) > 0.0:
                self._step.pause(paused_s)
            status = self.work(state)
        if status is Status.RUNNING and (pitch_rad := self.gimbal_pitch_rad()) is not None:
            self.point(GimbalTo(pitch_rad=pitch_rad))
        return status

    @abstractmethod
    def work(self, state: DroneState) -> Status:
        """Propose the movement of this tick, or return the final status."""

    def wait(self, state_age_s: float) -> Status:
        """Tick without fresh telemetry, whose age is inf before the first; the drone hovers."""
        del state_age_s
        return Status.RUNNING

    def gimbal_pitch_rad(self) -> float | None:
        """Return the gimbal's pitch while the leaf is RUNNING; None to leave it unchanged."""
        return None

    def terminate(self, new_status: Status) -> None:
        """Drop the movement; the arbiter cancels a movement that no leaf proposes."""
        del new_status
        self._step.drop(self.clock.now())
        self.leaf_clock.stop()

    def state(self) -> DroneState | None:
        """Return the drone's state, None when telemetry is stale."""
        return self.read(STATE).value

    def fails(self, reason: str) -> Status:
        """Return FAILURE, with its reason on the status line and as an event of the flight."""
        self.feedback_message = reason
        self.mission.add_event(EventKind.FAILED, f"{self.task}: {reason}", self.path)
        return Status.FAILURE

    @property
    def task(self) -> str:
        """What the leaf does, for events; by default its name."""
        return self.name

    @property
    def busy(self) -> bool:
        """Whether a movement is under way."""
        return self._step.busy

    @property
    def trouble(self) -> str:
        """Why the last FAILED movement failed, in a few words."""
        return self._step.trouble

    def moving(self, state: DroneState) -> bool:
        """Propose the movement in progress again; False without one. `progress` tells its end."""
        self.progress = self._step.update(state, self.clock.now())
        if self._step.proposal is not None:
            self.propose(self._step.proposal)
        return self.progress is Progress.RUNNING

    def moved(self, state: DroneState) -> Status | None:
        """Return RUNNING during a movement, FAILURE when it has failed, None without one."""
        if self.moving(state):
            return Status.RUNNING
        return self.fails(self.trouble) if self.progress is Progress.FAILED else None

    def start_move(
        self,
        *,
        forward_m: float = 0.0,
        right_m: float = 0.0,
        down_m: float = 0.0,
        yaw_rad: float = 0.0,
    ) -> None:
        """Start a movement and propose it.

        Args:
            forward_m: Distance ahead in the present body frame; negative is backward.
            right_m: Distance to the right in the present body frame.
            down_m: Distance down; negative climbs.
            yaw_rad: Turn, clockwise positive.

        Raises:
            MissionError: no telemetry has arrived yet.
        """
        if self._newest is None:
            raise MissionError("a movement starts from a known state: call start_move in work")
        wanted = MoveBy(id=0, forward_m=forward_m, right_m=right_m, down_m=down_m, yaw_rad=yaw_rad)
        self.propose(self._step.start(wanted, self._newest, self.clock.now()))
