"""Base of the leaves that make relative movements, one at a time."""

from __future__ import annotations

import math
from abc import abstractmethod
from typing import ClassVar, Final

from behaviours.fly.leaf_clock import LeafClock
from behaviours.fly.step import Progress, StepInHand
from uav_bt.board import STATE
from uav_bt.board.context import MissionContext
from uav_bt.errors import MissionError
from uav_bt.tree import Leaf, Status
from uav_bt.types import DroneState, Frame, GimbalTo, MoveBy

STRAIGHT_DOWN_RAD: Final = -math.pi / 2


def camera_points_at(
    frame: Frame | None, pitch_rad: float, *, slack_rad: float = math.radians(2)
) -> bool:
    """Return whether a frame was captured with the gimbal at a pitch; False without a frame."""
    return frame is not None and abs(frame.gimbal_pitch_rad - pitch_rad) < slack_rad


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
