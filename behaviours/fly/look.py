"""Small leaves that hover, turn and point the camera, and related conditions."""

from __future__ import annotations

import math

from behaviours.fly.leaf_clock import LeafClock
from behaviours.fly.moving_leaf import MovingLeaf, camera_points_at
from behaviours.fly.step import Progress
from uav_bt.board import FRAME, ODOMETRY, PHASE, STATE
from uav_bt.board.context import MissionContext
from uav_bt.tree import Leaf, Port, Status
from uav_bt.types import DroneState, GimbalTo, Hover, MissionPhase


class HoverFor(Leaf):
    """Hover for a time; time under manual control does not count."""

    repeats = True
    answers = (Status.SUCCESS, Status.RUNNING)
    moves = True
    ports = (Port("seconds", float, default=3.0, least=0, most=3600, doc="how long, s"),)
    writes = (PHASE,)

    def on_setup(self, mission: MissionContext) -> None:
        """Create the leaf's clock."""
        self._leaf_clock = LeafClock(mission.clock)

    def initialise(self) -> None:
        """Set the end time."""
        self.write(PHASE, MissionPhase.HOVER)
        self._until_s = self._leaf_clock.now() + self.port_value("seconds")

    def update(self) -> Status:
        """Hover until the time is over."""
        self._leaf_clock.tick()
        if self._leaf_clock.now() >= self._until_s:
            return Status.SUCCESS
        self.propose(Hover())
        return Status.RUNNING

    def terminate(self, new_status: Status) -> None:
        """Stop the clock."""
        del new_status
        self._leaf_clock.stop()


class PointCamera(Leaf):
    """Tilt the camera and wait until a frame was captured at that pitch."""

    repeats = True
    answers = (Status.SUCCESS, Status.RUNNING)
    points = True
    ports = (
        Port(
            "pitch_deg",
            float,
            default=-28.0,
            least=-90,
            most=90,
            doc="0 level, -90 straight down, degrees",
        ),
    )
    reads = (FRAME,)

    def update(self) -> Status:
        """Propose the pitch until a frame has it."""
        pitch_rad = math.radians(self.port_value("pitch_deg"))
        if camera_points_at(self.read(FRAME).value, pitch_rad):
            return Status.SUCCESS
        self.point(GimbalTo(pitch_rad=pitch_rad))
        return Status.RUNNING


class Turn(MovingLeaf):
    """Turn on the spot; FAILURE after repeated attempts without progress.

    After an interruption by an override or a pilot the drone turns on to the same heading.
    """

    repeats = True
    ports = (
        Port("degrees", float, least=-360, most=360, doc="clockwise positive, seen from above"),
    )
    reads = (STATE,)
    writes = (PHASE,)

    def initialise(self) -> None:
        """Begin with the turn."""
        self.write(PHASE, MissionPhase.LOOK)
        self._begun = False

    def work(self, state: DroneState) -> Status:
        """Turn until the drone reports the end."""
        if not self._begun:
            self._begun = True
            self.start_move(yaw_rad=math.radians(self.port_value("degrees")))
            return Status.RUNNING
        if self.moving(state):
            return Status.RUNNING
        if self.progress is Progress.DONE:
            return Status.SUCCESS
        self.feedback_message = self.trouble
        return Status.FAILURE


class Hovering(Leaf):
    """SUCCESS while the drone keeps its place, even if it turns; FAILURE on stale telemetry."""

    condition = True
    ports = (
        Port(
            "below_mps",
            float,
            default=0.15,
            least=0,
            most=10,
            doc="horizontal speed that counts as none, m/s",
        ),
    )
    reads = (STATE, ODOMETRY)

    def update(self) -> Status:
        """Compare the horizontal speed with the largest allowed."""
        state = self.read(STATE).value
        if state is None:
            return Status.FAILURE
        motion = self.read(ODOMETRY).value
        state = state if motion is None else motion.over_ground(state)
        speed_mps = math.hypot(state.velocity.forward_mps, state.velocity.right_mps)
        return Status.SUCCESS if speed_mps < self.port_value("below_mps") else Status.FAILURE
