"""Leaves that find the landing mark, fly to it under a policy, and stop above it."""

from __future__ import annotations

import math
from typing import Final

from behaviours.fly.course_leaf import GIMBAL, CourseLeaf
from behaviours.fly.mark_track import AHEAD_RAD, TRACK_KEYS, believed_fix, is_clear, straight_to
from behaviours.fly.steering import FLOWING, POLICY, SteeringLeaf
from behaviours.path.gimbal_pointing import mark_pitch_rad
from behaviours.policies.coverage_policy import CoveragePolicy
from behaviours.ports import number
from uav_bt.answers import Advance, Answer, Blocked, Done, FollowLeg, Rotate
from uav_bt.board import HELD_TURN, PHASE, SITE_MAP
from uav_bt.board.blackboard import Key
from uav_bt.board.context import MissionContext
from uav_bt.tree import Leaf, Port, Status
from uav_bt.types import DroneState, HeldTurn, MarkFix, MissionPhase

TRACK_TRIED: Final = Key(
    "track_tried_s",
    float,
    "capture up to which sightings of the mark did not lead to it",
    unit="s",
    writer="StopAboveMark",
)
_MARK_LOST: Final = "mark lost: not seen for long, and not on the map"
_CARRIED_STD_M: Final = 0.3  # largest standard deviation of a usable track without a new sighting
_LED_S: Final = 48.0  # a search by the map looks below this much later; chosen
_SCAN_RADPS: Final = 0.8  # rate of a turn: 5 degrees per frame at 10 frames per second
# A mark behind the drone and nearer than this is in view of a camera that looks straight down;
# chosen.
_PASSED_M: Final = 0.35

# When the way is free for a policy; chosen in flights of the student beside boxes.
_BEFORE_M: Final = 0.35  # the way needs to be free up to this distance before the mark's middle
_MIN_FREE_M: Final = 0.3  # the way is blocked when less is free, unless the mark is nearer
_JUDGED_S: Final = 0.6  # the policy's last answer is valid for this time
# The mark is out of view without a sighting for this time, the 15 frames of the paper.
_OUT_OF_VIEW_S: Final = 0.5
_CLOSE_M: Final = 1.25  # nearer, a mark out of view is below it; further away it is hidden
_AT_MARK_M: Final = 0.5  # the last metre begins at this range
_NEARER_M: Final = 0.5  # a stop this much nearer to the mark than the last is at another obstacle
_TRIES: Final = 4  # failed detours to one side before the other side is tried
_RELIEVED_AFTER: Final = 2  # failed detours after which the policy decides as after a full turn


def _given_pitch_rad(leaf: CourseLeaf) -> float:
    """Return the camera's pitch that the port gives."""
    return math.radians(leaf.port_value("gimbal_deg"))


class MarkFound(Leaf):
    """SUCCESS while the landing mark is in view, or its place is known well enough to fly to.

    A mark of the map always is: from nearer its place is corrected. A track without one needs a
    small error. A place that did not lead to the mark counts again after a new sighting.
    """

    group = "Parts of shipped subtrees"
    condition = True
    reads = (*TRACK_KEYS, TRACK_TRIED)

    def on_setup(self, mission: MissionContext) -> None:
        """Note the height of the mark."""
        self._mark_m = mission.mark.height_m

    def update(self) -> Status:
        """Judge the track."""
        fix, tried_s = believed_fix(self, self._mark_m), self.read(TRACK_TRIED).value
        if fix is None:
            return Status.FAILURE
        site_map = self.read(SITE_MAP).value
        known = fix.std_m <= _CARRIED_STD_M or (site_map is not None and site_map.mark is not None)
        carried = known and (tried_s is None or fix.captured_s > tried_s)
        return Status.SUCCESS if fix.detected or carried else Status.FAILURE


class SearchUnderPolicy(SteeringLeaf):
    """Advance and turn as a leaf policy decides; FAILURE when it is time to look below.

    A mark nearer than about a metre is below the forward view. With `by_map` and a site map the
    drone covers ground as a survey does, in place of the policy, and looks below 48 s later,
    or as soon as no ground is left to cover.
    """

    points = True
    group = "Parts of shipped subtrees"
    answers = (Status.FAILURE, Status.RUNNING)
    ports = (
        *(POLICY, FLOWING, GIMBAL),
        number("first_s", 12.0, 0, 3600, "until the first look below, s"),
        number("next_s", 30.0, 0, 3600, "until each further one, s"),
        Port(
            "by_map",
            bool,
            default=False,
            doc="whether the planner of a survey leads where there is a site map",
        ),
    )

    def on_setup(self, mission: MissionContext) -> None:
        """Find the policy; the time begins with the first search."""
        super().on_setup(mission)
        self._given, self._planner = self._policy, CoveragePolicy()
        self._scan_s: float | None = None
        self._led = False  # by the map
        self._covered = False  # the planner knows no more ground

    def initialise(self) -> None:
        """Only views captured from now on count."""
        self.drop_course()
        self.write(PHASE, MissionPhase.SEARCH)
        if self._scan_s is None:
            self._scan_s = self.leaf_clock.now() + self.port_value("first_s")

    def work(self, state: DroneState) -> Status:
        """Advance and turn until the next look below is due."""
        now_s, more_s = self.leaf_clock.now(), _LED_S if self._led and not self._covered else 0.0
        if self._scan_s is not None and now_s >= self._scan_s + more_s and not self.busy:
            self._scan_s = now_s + self.port_value("next_s")
            return Status.FAILURE
        led = self.port_value("by_map") and self.read(SITE_MAP).value is not None
        if led != self._led:  # a step under the policy is broken off
            self._led, self._policy = led, self._planner if led else self._given
            self.drop_course()
        self.wander(state)
        return Status.RUNNING

    def decide(self) -> Answer | None:
        """Ask the policy or the planner, and note whether all ground is covered."""
        answer = super().decide()
        self._covered = isinstance(answer, Done) or (self._covered and answer is None)
        return answer

    def gimbal_pitch_rad(self) -> float:
        """Return the pitch in flight, as policies expect; by the map also lower, for the ground."""
        flight_rad = _given_pitch_rad(self)
        return self.ground_pitch_rad(flight_rad) if self._led else flight_rad


class ScanBelow(CourseLeaf):
    """Make one full turn with the camera down; FAILURE at its end."""

    points = True
    group = "Parts of shipped subtrees"
    answers = (Status.FAILURE, Status.RUNNING)
    ports = (number("gimbal_deg", -65.0, -90, 90, "camera pitch, degrees"),)

    def initialise(self) -> None:
        """Begin the turn."""
        self.write(PHASE, MissionPhase.SEARCH)
        self._left_rad = 2.0 * math.pi
        self._yaw_rad: float | None = None

    def work(self, state: DroneState) -> Status:
        """Turn."""
        yaw_rad = state.attitude.yaw_rad
        if self._yaw_rad is not None:
            self._left_rad -= math.remainder(yaw_rad - self._yaw_rad, 2.0 * math.pi)
        self._yaw_rad = yaw_rad
        if self._left_rad <= 0.0:
            return Status.FAILURE
        self.feedback_message = "looks down"
        self.propose(self.turn_keeping_away(_SCAN_RADPS))
        return Status.RUNNING

    gimbal_pitch_rad = _given_pitch_rad


class StopAboveMark(CourseLeaf):
    """Fly the last metre straight to the mark; SUCCESS above its place, FAILURE when it is lost.

    The mark may have left the view by the lower edge.
    """

    points = True
    group = "Parts of shipped subtrees"
    ports = (
        GIMBAL,
        number("arrive_m", 0.12, 0.01, 2, "horizontal distance that counts as above, m"),
    )
    reads = (*CourseLeaf.reads, *TRACK_KEYS)
    writes = (*CourseLeaf.writes, TRACK_TRIED)

    def on_setup(self, mission: MissionContext) -> None:
        """Note the height of the mark."""
        super().on_setup(mission)
        self._mark_m = mission.mark.height_m

    def initialise(self) -> None:
        """Drop the course."""
        self.write(PHASE, MissionPhase.APPROACH)
        self.drop_course()

    def work(self, state: DroneState) -> Status:
        """Fly on until above the mark."""
        fix = believed_fix(self, self._mark_m)
        if fix is None:
            return self.fails(_MARK_LOST)
        passed = fix.forward_m < 0.0 and fix.range_m < _PASSED_M
        if passed or fix.range_m < self.port_value("arrive_m"):
            # If no mark is found below, its place counts again only after a new sighting.
            self.write(TRACK_TRIED, fix.captured_s)
            return Status.SUCCESS
        if not is_clear(self, fix.forward_m, fix.right_m):
            return self.fails("an obstacle is near the last metre to the mark")
        answer = straight_to(fix)
        self.feedback_message = answer.reason
        self.fly_on(state, answer)
        return Status.RUNNING

    def gimbal_pitch_rad(self) -> float:
        """Return the camera's pitch, which follows the mark down."""
        flight_rad = _given_pitch_rad(self)
        fix, state = believed_fix(self, self._mark_m), self.state()
        if fix is None or state is None:
            return flight_rad
        return mark_pitch_rad(fix.range_m, state.height_above_ground_m - fix.height_m, flight_rad)


class Detour(SteeringLeaf):
    """Turn away and take steps as a leaf policy decides; FAILURE after them, or without a track.

    It ends in FAILURE, so that the next leaf faces the mark again.
    """

    points = True
    group = "Parts of shipped subtrees"
    answers = (Status.FAILURE, Status.RUNNING)
    ports = (
        *(POLICY, FLOWING, GIMBAL),
        Port("steps", int, default=2, least=1, most=100, doc="steps that are taken"),
        number("turn_away_deg", 0.0, 0, 360, "least turn at its beginning, to the held side, deg"),
    )
    reads = (*SteeringLeaf.reads, *TRACK_KEYS)

    def initialise(self) -> None:
        """Begin; only views captured from now on count."""
        self.drop_course()
        self._begun, self._steps = False, 0

    def work(self, state: DroneState) -> Status:
        """Continue a step or a turn, or begin the next one."""
        if believed_fix(self, 0.0) is None:
            return Status.FAILURE
        away_rad = math.radians(self.port_value("turn_away_deg"))
        if not self._begun and away_rad > 0.0:
            self.keep_turning(state, away_rad)
        elif self._steps >= self.port_value("steps"):
            if not self.moving(state):
                return Status.FAILURE
        elif self.wander(state):
            self._steps += 1
        self._begun = True
        return Status.RUNNING

    gimbal_pitch_rad = _given_pitch_rad  # policies expect views at that pitch


def free_ahead_m(answer: Answer) -> float:
    """Return how far a policy finds the way free of obstacles, regardless of the ground's end."""
    match answer:
        case Advance():
            return math.inf if answer.free_m is None else max(answer.free_m, answer.forward_m)
        case Blocked():
            unknown_m = math.inf if answer.ground_ends else 0.0
            return unknown_m if answer.free_m is None else answer.free_m
        case FollowLeg() | Rotate():  # no free distance in these answers
            return math.inf
        case Done():
            return 0.0


class GoToMarkUnderPolicy(SteeringLeaf):
    """Turn to the tracked mark, and fly straight while the policy finds the way free.

    SUCCESS where the last metre begins. FAILURE when the way is blocked; `Detour` then begins in
    the direction of the held turn. The side is kept until `tries` detours have failed: a step
    further on, the policy may prefer the other side, and the drone would fly to and fro.
    """

    points = True
    group = "Parts of shipped subtrees"
    ports = (POLICY, GIMBAL)
    reads = (*SteeringLeaf.reads, *TRACK_KEYS)

    def on_setup(self, mission: MissionContext) -> None:
        """Find the policy."""
        super().on_setup(mission)
        self._side = 0  # side of the detours: +1 clockwise, -1 counter-clockwise
        self._stopped_m = math.inf  # range of the mark at the last obstacle
        self._in_vain = 0

    def initialise(self) -> None:
        """Face the mark."""
        self.write(PHASE, MissionPhase.APPROACH)
        self.write(HELD_TURN, HeldTurn(relief_turns=self._relief_turns))
        self.drop_course()
        self._judged_s, self._free_m = -math.inf, 0.0

    def work(self, state: DroneState) -> Status:
        """Ask the policy about each view that faces the mark."""
        fix, now_s = believed_fix(self, 0.0), self.clock.now()
        if fix is None:
            return self.fails(_MARK_LOST)
        ahead = abs(fix.bearing_rad) < AHEAD_RAD
        below = ahead and not fix.detected and now_s - fix.captured_s > _OUT_OF_VIEW_S
        near = fix.range_m <= _AT_MARK_M or (below and fix.range_m < _CLOSE_M)
        if near and is_clear(self, fix.forward_m, fix.right_m):
            self._side = 0
            return Status.SUCCESS
        answer = self.decide() if ahead else None
        if answer is not None:
            self._judged_s, self._free_m = now_s, free_ahead_m(answer)
            if self._free_m < min(_MIN_FREE_M, fix.range_m - _BEFORE_M):
                return self._blocked(fix, answer)
        judged = now_s - self._judged_s <= _JUDGED_S
        course = straight_to(fix, most_m=self._free_m if judged else 0.0)
        self.feedback_message = course.reason
        self.fly_on(state, course)
        return Status.RUNNING

    gimbal_pitch_rad = _given_pitch_rad  # policies expect views at that pitch

    def _blocked(self, fix: MarkFix, answer: Answer) -> Status:
        """Hold a turn to the side of the next detour."""
        if self._side == 0 or fix.range_m <= self._stopped_m - _NEARER_M:
            left = isinstance(answer, Advance | Blocked) and answer.yaw_rad < 0.0
            self._side, self._stopped_m, self._in_vain = -1 if left else 1, fix.range_m, 0
        else:
            self._in_vain += 1
            if self._in_vain % _TRIES == 0:
                self._side = -self._side
        self.write(HELD_TURN, HeldTurn(direction=self._side, relief_turns=self._relief_turns))
        return Status.FAILURE

    @property
    def _relief_turns(self) -> int:
        return 1 if self._in_vain >= _RELIEVED_AFTER else 0
