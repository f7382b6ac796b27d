"""One movement at a time on behalf of a leaf: proposed every tick until the drone says it ended."""

from __future__ import annotations

import enum
import math

from uav_bt.board.context import MissionContext, Proposals
from uav_bt.tree import Leaf, Status
from uav_bt.types import DroneState, MoveBy, MovementState

# Slower than any drone this flies: what takes longer than this was lost on the way.
_SLOWEST_MPS = 0.1
_SLOWEST_RADPS = 0.2
_GRACE_S = 4.0


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
    """

    def __init__(self) -> None:
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
        """Take up a new movement (the old one, if any, is superseded) and return it."""
        self.proposal = MoveBy(
            id=proposals.next_id(),
            forward_m=forward_m,
            right_m=right_m,
            down_m=down_m,
            yaw_rad=yaw_rad,
        )
        length_m = abs(forward_m) + abs(right_m) + abs(down_m)
        self._deadline_s = (
            now_s + length_m / _SLOWEST_MPS + abs(yaw_rad) / _SLOWEST_RADPS + _GRACE_S
        )
        return self.proposal

    def update(self, state: DroneState, now_s: float) -> Progress:
        """Look at the drone's word on the movement; it is dropped when it ended."""
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


class MovingLeaf(Leaf):
    """Base of the leaves that make relative movements."""

    def on_setup(self, mission: MissionContext) -> None:
        """Make the movement's keeper."""
        del mission
        self._mover = Mover()

    def terminate(self, new_status: Status) -> None:
        """Let go of the movement; the arbiter cancels what is no longer proposed."""
        del new_status
        self._mover.drop(self.clock.now())

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
        """Start a movement, in the body frame of now, and propose it."""
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
