"""Small leaves that hover, move, point the camera and add messages, and related conditions."""

from __future__ import annotations

import math
from typing import Final

from behaviours.fly.moving_leaf import LeafClock, MovingLeaf, Progress, camera_points_at
from behaviours.path.margins import Margins
from behaviours.path.nearby import recent_obstacles
from behaviours.path.passages import route
from behaviours.ports import number
from uav_bt.board import FRAME, ODOMETRY, PHASE, SITE_MAP, STATE
from uav_bt.board.context import MissionContext
from uav_bt.board.keys import BATTERY_PER_MIN, BATTERY_SHARE, FLYING, HOME
from uav_bt.tree import Leaf, Port, Status
from uav_bt.tree.script.parser import fill_text, parse_text
from uav_bt.types import DroneState, GimbalTo, Hover, MissionPhase, Pose2D
from uav_bt.types.flight_results import EventKind

_TEXT: Final = "one line; {variable} and {@board_key} are replaced by their values"
# The numbers were chosen.
_SPEED_MPS: Final = 0.4  # mean speed on the way home
_DETOUR: Final = 1.5  # length of the way over the straight distance, where no route is known
_LANDING_S: Final = 30.0  # from the arrival to the landing
_USE_PER_MIN: Final = 0.05  # before it is measured: an ANAFI is empty after 25 minutes
_PLAN_EVERY_S: Final = 2.0  # time between two plans of the route
_HOME_M: Final = 1.0  # largest distance from the end of the route to the take-off point


class HoverFor(Leaf):
    """Hover for a time; time under manual control does not count."""

    repeats = True
    answers = (Status.SUCCESS, Status.RUNNING)
    moves = True
    ports = (number("seconds", 3.0, 0, 3600, "how long, s"),)
    writes = (PHASE,)

    def initialise(self) -> None:
        """Set the end time."""
        self.write(PHASE, MissionPhase.HOVER)
        self._leaf_clock = LeafClock(self.clock)
        self._until_s = self._leaf_clock.now() + self.port_value("seconds")

    def update(self) -> Status:
        """Hover until the time is over."""
        self._leaf_clock.tick()
        if self._leaf_clock.now() >= self._until_s:
            return Status.SUCCESS
        self.propose(Hover())
        return Status.RUNNING


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
        elif not self.moving(state):
            return Status.SUCCESS if self.progress is Progress.DONE else self.fails(self.trouble)
        return Status.RUNNING


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

    group = "Parts of shipped subtrees"
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


class CanReturn(Leaf):
    """SUCCESS while the battery suffices for the way to the take-off point and a landing.

    The use of the battery is that of the present flight. The way is the route over the site map,
    or 1.5 times the straight distance where the map has no route. A drone on the ground is at home.
    While the place is unknown the last known distance counts. FAILURE without a report of the
    battery, and in the air as long as the distance was never known.
    """

    condition = True
    ports = (number("reserve", 0.15, 0, 1, "share of the battery left after the landing"),)
    reads = (BATTERY_SHARE, BATTERY_PER_MIN, FLYING, HOME, SITE_MAP)

    def on_setup(self, mission: MissionContext) -> None:
        """Start without a distance."""
        import behaviours.path.compiled_loops  # noqa: F401, PLC0415  (compiled before the flight)

        self._margins = Margins().within(mission.clearances, mission.mark)
        self._planned_s, self._detour = -math.inf, _DETOUR
        self._way_m: float | None = None

    def update(self) -> Status:
        """Compare the charge with the need of the way home."""
        charge, per_min = self.read(BATTERY_SHARE).value, self.read(BATTERY_PER_MIN).value
        if charge is None or charge < 0.0:
            self.feedback_message = "the battery is unknown"
            return Status.FAILURE
        way_m = self._way()
        if way_m is None:
            self.feedback_message = "the way home is unknown"
            return Status.FAILURE
        if per_min is None or per_min < 0.0:
            per_min = _USE_PER_MIN
        need = per_min * (way_m / _SPEED_MPS + _LANDING_S) / 60.0
        self.feedback_message = f"{way_m:.1f} m home take {100 * need:.0f} % of the battery"
        return Status.SUCCESS if charge - need >= self.port_value("reserve") else Status.FAILURE

    def _way(self) -> float | None:
        """Return the length of the way home, metres; None if it was never known."""
        if not self.read(FLYING).value:
            return 0.0
        home_m, site_map = self.read(HOME).value, self.read(SITE_MAP).value
        if home_m is not None and home_m >= 0.0:
            now_s = self.clock.now()
            if site_map is not None and now_s - self._planned_s >= _PLAN_EVERY_S:
                self._planned_s, self._detour = now_s, _DETOUR
                recent, start = recent_obstacles(site_map.near, site_map), site_map.start
                to = (start.x_m, start.y_m)
                planned = route(site_map, to, self._margins, recent=recent, near_m=_HOME_M)
                if planned is not None and home_m >= _HOME_M:
                    self._detour = max((planned.length_m + _HOME_M) / home_m, 1.0)
            self._way_m = self._detour * home_m
        return self._way_m


class Say(Leaf):
    """Add a message to the flight's events; SUCCESS always."""

    answers = (Status.SUCCESS,)
    ports = (
        Port("text", str, check=parse_text, doc=_TEXT),
        Port("level", str, "info", "info or warning", choices=("info", "warning")),
    )

    def update(self) -> Status:
        """Add the message; a name without a value becomes "unknown"."""
        self.feedback_message = text = fill_text(self.port_value("text"), self.environment)
        self.mission.add_event(EventKind(self.port_value("level")), text, self.path)
        return Status.SUCCESS
