"""Small leaves that hover, turn, point the camera and add messages, and related conditions."""

from __future__ import annotations

import math

from behaviours.fly.moving_leaf import LeafClock, MovingLeaf, Progress, camera_points_at
from behaviours.ports import number
from uav_bt.board import FRAME, ODOMETRY, PHASE, STATE
from uav_bt.board.context import MissionContext
from uav_bt.tree import Leaf, Port, Status
from uav_bt.tree.script.parser import fill_text, parse_text
from uav_bt.types import DroneState, GimbalTo, Hover, MissionPhase, Pose2D
from uav_bt.types.flight_results import EventKind


class HoverFor(Leaf):
    """Hover for a time; time under manual control does not count."""

    repeats = True
    answers = (Status.SUCCESS, Status.RUNNING)
    moves = True
    ports = (number("seconds", 3.0, 0, 3600, "how long, s"),)
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
    ports = (number("pitch_deg", -28.0, -90, 90, "0 level, -90 straight down, degrees"),)
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
    ports = (number("degrees", None, -360, 360, "clockwise positive, seen from above"),)
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
    ports = (number("below_mps", 0.15, 0, 10, "horizontal speed that counts as none, m/s"),)
    reads = (STATE, ODOMETRY)

    def update(self) -> Status:
        """Compare the horizontal speed with the largest allowed."""
        state, motion = self.read(STATE).value, self.read(ODOMETRY).value
        if state is None:
            return Status.FAILURE
        velocity = (state if motion is None else motion.over_ground(state)).velocity
        speed_mps = math.hypot(velocity.forward_mps, velocity.right_mps)
        return Status.SUCCESS if speed_mps < self.port_value("below_mps") else Status.FAILURE


class MovesOn(Leaf):
    """SUCCESS while the drone moves on; FAILURE when it has stayed around one place for too long.

    Time in which the leaf is not ticked does not count. The place and the time are kept when the
    tree tries again, so that attempts at one place do not add up. Without odometry the answer is
    SUCCESS.
    """

    condition = True
    ports = (
        number("within_m", 0.5, 0.1, 100, "a drone within this distance of a place stays there, m"),
        # Chosen: one look for a way (15 s), a full turn of a detour (11 s) and one of a scan below
        # (8 s) take 34 s. A drone that could go on has done so after them.
        number("for_s", 60.0, 1, 3600, "longest stay, s"),
    )
    reads = (ODOMETRY,)

    def on_setup(self, mission: MissionContext) -> None:
        """Start without a place."""
        self._clock = LeafClock(mission.clock)
        self._place: Pose2D | None = None
        self._since_s = 0.0  # leaf's time

    def update(self) -> Status:
        """Compare the time since the drone came to its place with the longest stay."""
        self._clock.tick()
        motion, place, now_s = self.read(ODOMETRY).value, self._place, self._clock.now()
        if motion is None:
            return Status.SUCCESS
        here, within_m = motion.pose, self.port_value("within_m")
        if place is None or math.hypot(here.x_m - place.x_m, here.y_m - place.y_m) > within_m:
            self._place, self._since_s = here, now_s
        stayed_s = now_s - self._since_s
        self.feedback_message = f"{stayed_s:.0f} s at one place"
        return Status.SUCCESS if stayed_s < self.port_value("for_s") else Status.FAILURE


class Say(Leaf):
    """Add a message to the flight's events; SUCCESS always."""

    answers = (Status.SUCCESS,)
    ports = (
        Port(
            "text",
            str,
            check=parse_text,
            doc="one line; {variable} and {@board_key} are replaced by their values",
        ),
        Port(
            "level",
            str,
            default=EventKind.INFO.value,
            choices=(EventKind.INFO.value, EventKind.WARNING.value),
            doc="kind of the event: info or warning",
        ),
    )

    def update(self) -> Status:
        """Add the message; a name without a value becomes "unknown"."""
        text = fill_text(self.port_value("text"), self.environment)
        self.feedback_message = text
        self.mission.add_event(EventKind(self.port_value("level")), text, self.path)
        return Status.SUCCESS


NODES = (HoverFor, Hovering, MovesOn, PointCamera, Say, Turn)
