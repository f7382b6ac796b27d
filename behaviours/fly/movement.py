"""One relative movement at a time: proposed every tick until the drone reports its end."""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass

from uav_bt.board import STATE
from uav_bt.board.context import MissionContext, Proposals
from uav_bt.tree import Leaf, Status
from uav_bt.types import DroneState, Frame, GimbalTo, MoveBy, MovementState

STRAIGHT_DOWN_RAD = -math.pi / 2


@dataclass(frozen=True, kw_only=True)
class MovementConfig:
    """When a movement whose end was not reported counts as failed."""

    min_speed_mps: float = 0.1  # slower than any drone flies a step
    min_yaw_rate_radps: float = 0.2  # slower than any drone turns
    grace_s: float = 4.0  # besides: for the command's latency, acceleration and settling


class Progress(enum.Enum):
    """How the movement in hand is doing."""

    IDLE = "idle"  # there is none
    RUNNING = "running"  # it was proposed again
    DONE = "done"
    FAILED = "failed"  # interrupted, rejected or never acknowledged


class Mover:
    """Holds the `MoveBy` in progress.

    The owner starts one, calls `update` every tick, and proposes what `proposal` gives. Nothing is
    commanded from here: a halted leaf stops proposing, and the arbiter cancels the movement.

    Args:
        config: when a movement counts as failed.
    """

    def __init__(self, config: MovementConfig | None = None) -> None:
        self._config = config or MovementConfig()
        self.proposal: MoveBy | None = None
        self.ended_s = -math.inf  # when the last movement ended: frames before it show the old view
        self._deadline_s = math.inf

    @property
    def busy(self) -> bool:
        """True while a movement is in progress."""
        return self.proposal is not None

    def start(
        self,
        proposals: Proposals,
        now_s: float,
        *,
        forward_m: float = 0.0,
        right_m: float = 0.0,
        down_m: float = 0.0,
        yaw_rad: float = 0.0,
    ) -> MoveBy:
        """Start a movement, in place of the one in progress, and return it.

        Args:
            proposals: numbers the movement.
            now_s: the mission clock's time.
            forward_m: in the body frame of now; negative is backward.
            right_m: in the body frame of now.
            down_m: negative climbs.
            yaw_rad: clockwise positive.
        """
        self.proposal = MoveBy(
            id=proposals.next_id(),
            forward_m=forward_m,
            right_m=right_m,
            down_m=down_m,
            yaw_rad=yaw_rad,
        )
        cfg, length_m = self._config, abs(forward_m) + abs(right_m) + abs(down_m)
        self._deadline_s = (
            now_s
            + length_m / cfg.min_speed_mps
            + abs(yaw_rad) / cfg.min_yaw_rate_radps
            + cfg.grace_s
        )
        return self.proposal

    def update(self, state: DroneState, now_s: float) -> Progress:
        """Return what the drone reports on the movement, which is dropped when it has ended.

        Args:
            state: the drone's newest telemetry.
            now_s: the mission clock's time.
        """
        if self.proposal is None:
            return Progress.IDLE
        status = state.movement
        if status is not None and status.id == self.proposal.id:
            if status.state is MovementState.DONE:
                self._end(state.captured_s)
                return Progress.DONE
            if status.state in {MovementState.INTERRUPTED, MovementState.REJECTED}:
                self._end(state.captured_s)
                return Progress.FAILED
        if now_s > self._deadline_s:
            self._end(now_s)
            return Progress.FAILED
        return Progress.RUNNING

    def drop(self, now_s: float) -> None:
        """Forget the movement: its owner was halted or changed its mind."""
        if self.proposal is not None:
            self._end(now_s)

    def _end(self, time_s: float) -> None:
        self.proposal = None
        self.ended_s = time_s


def camera_points_at(
    frame: Frame | None, pitch_rad: float, *, slack_rad: float = math.radians(2)
) -> bool:
    """Return whether a frame was captured with the gimbal at a pitch; False without a frame.

    Args:
        frame: the newest.
        pitch_rad: 0 level, negative down.
        slack_rad: difference that is none.
    """
    return frame is not None and abs(frame.gimbal_pitch_rad - pitch_rad) < slack_rad


class MovingLeaf(Leaf):
    """Base of the leaves that make relative movements; what they do in a tick is `work`."""

    def on_setup(self, mission: MissionContext) -> None:
        """Begin without a movement."""
        del mission
        self._mover = Mover()

    def update(self) -> Status:
        """Do the leaf's work, once there is telemetry, and point the gimbal while it is RUNNING.

        A leaf that has ended points nothing: the next one may do so within the same tick.
        """
        state = self.state()
        status = Status.RUNNING if state is None else self.work(state)
        if status is Status.RUNNING:
            pitch_rad = self.gimbal_pitch_rad()
            if pitch_rad is not None:
                self.point(GimbalTo(pitch_rad=pitch_rad))
        return status

    def work(self, state: DroneState) -> Status:
        """Propose what the leaf wants in this tick, or end."""
        raise NotImplementedError

    def gimbal_pitch_rad(self) -> float | None:
        """Return the gimbal's pitch while the leaf is RUNNING, None to leave it as it is."""
        return None

    def terminate(self, new_status: Status) -> None:
        """Drop the movement; the arbiter cancels what is no longer proposed."""
        del new_status
        self._mover.drop(self.clock.now())

    def state(self) -> DroneState | None:
        """Return the drone's state, None when telemetry is stale."""
        return self.read(STATE).value

    def moving(self, state: DroneState) -> bool:
        """Propose the movement in progress again; False when there is none (any more)."""
        if self._mover.update(state, self.clock.now()) is not Progress.RUNNING:
            return False
        if self._mover.proposal is not None:
            self.propose(self._mover.proposal)
        return True

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
        """
        self.propose(
            self._mover.start(
                self.mission.proposals,
                self.clock.now(),
                forward_m=forward_m,
                right_m=right_m,
                down_m=down_m,
                yaw_rad=yaw_rad,
            )
        )
