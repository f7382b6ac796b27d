"""The base of the leaves that move: one relative movement at a time."""

from __future__ import annotations

import math
from abc import abstractmethod
from typing import ClassVar

from behaviours.fly.leaf_clock import LeafClock
from behaviours.fly.step import Progress, StepInHand
from uav_bt.board import STATE
from uav_bt.board.context import MissionContext
from uav_bt.errors import MissionError
from uav_bt.tree import Leaf, Status
from uav_bt.types import DroneState, Frame, GimbalTo

STRAIGHT_DOWN_RAD = -math.pi / 2


def camera_points_at(
    frame: Frame | None, pitch_rad: float, *, slack_rad: float = math.radians(2)
) -> bool:
    """Return whether a frame was captured with the gimbal at a pitch; False without a frame.

    Args:
        frame: the newest.
        pitch_rad: 0 level, negative down.
        slack_rad: greatest difference, radians.
    """
    return frame is not None and abs(frame.gimbal_pitch_rad - pitch_rad) < slack_rad


class MovingLeaf(Leaf):
    """Base of the leaves that make relative movements; `work` is the work of a tick.

    A movement that ends early, because an override let the drone hover or a person flew, goes on by
    itself: the heading by the attitude, the height by the altimeter, a step by dead reckoning. Only
    a step that a person interrupted does not, because nobody knows where the drone was flown; it
    has ended, and the leaf decides anew.
    """

    moves = True
    resumes: ClassVar[bool] = True  # False: a movement that ends early has ended; decide anew

    def on_setup(self, mission: MissionContext) -> None:
        """Begin without a movement."""
        self._step = StepInHand(mission.proposals, resumes=self.resumes)
        self._progress = Progress.IDLE
        self._newest: DroneState | None = None
        self.leaf_clock = LeafClock(mission.clock)

    def update(self) -> Status:
        """Do the leaf's work, once there is telemetry, and point the gimbal while it is RUNNING.

        A leaf that has ended points nothing: the next one may do so within the same tick.
        """
        state = self.state()
        status = self.wait(self.read(STATE).age_s) if state is None else self._work(state)
        if status is Status.RUNNING:
            pitch_rad = self.gimbal_pitch_rad()
            if pitch_rad is not None:
                self.point(GimbalTo(pitch_rad=pitch_rad))
        return status

    def _work(self, state: DroneState) -> Status:
        self._newest = state
        paused_s = self.leaf_clock.tick()
        if paused_s > 0.0:
            self._step.pause(paused_s)
        return self.work(state)

    @abstractmethod
    def work(self, state: DroneState) -> Status:
        """Propose the movement of this tick, or end."""

    def wait(self, state_age_s: float) -> Status:
        """Tick without fresh telemetry; a leaf that proposes nothing hovers.

        Args:
            state_age_s: age of the newest telemetry, seconds; inf before the first.
        """
        del state_age_s
        return Status.RUNNING

    def gimbal_pitch_rad(self) -> float | None:
        """Return the gimbal's pitch while the leaf is RUNNING, None to leave it as it is."""
        return None

    def terminate(self, new_status: Status) -> None:
        """Drop the movement; the arbiter cancels a movement that nobody proposes."""
        del new_status
        self._step.drop(self.clock.now())
        self.leaf_clock.stop()

    def state(self) -> DroneState | None:
        """Return the drone's state, None when telemetry is stale."""
        return self.read(STATE).value

    @property
    def progress(self) -> Progress:
        """What `moving` found in this tick; that a movement has ended it finds once."""
        return self._progress

    @property
    def busy(self) -> bool:
        """Whether a movement is under way."""
        return self._step.busy

    @property
    def trouble(self) -> str:
        """Why the last movement that FAILED did, in a few words."""
        return self._step.trouble

    def moving(self, state: DroneState) -> bool:
        """Propose the movement in progress again; False when there is none (any more).

        `progress` says how it ended.
        """
        self._progress = self._step.update(state, self.clock.now())
        if self._step.proposal is not None:
            self.propose(self._step.proposal)
        return self._progress is Progress.RUNNING

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
            forward_m: in the body frame of now; negative is backward.
            right_m: in the body frame of now.
            down_m: negative climbs.
            yaw_rad: clockwise positive.

        Raises:
            MissionError: no telemetry has come yet.
        """
        if self._newest is None:
            raise MissionError("a movement starts from a known state: call start_move in work")
        self.propose(
            self._step.start(
                self._newest,
                self.clock.now(),
                forward_m=forward_m,
                right_m=right_m,
                down_m=down_m,
                yaw_rad=yaw_rad,
            )
        )
