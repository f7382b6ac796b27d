"""HelipadCenter: point the camera straight down, climb a little, and centre it above the pad.

The leaf centres twice: high up, where the pad is in view, and again lower down. The drone drifts
while it descends, and the last descent, which is blind, should be short. Centring is position-based
visual servoing (Chaumette and Hutchinson, 2006): a velocity in proportion to the camera's offset,
updated on every frame. Steps would not converge in gusts: each ends some centimetres off.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

from behaviours.fly.moving_leaf import STRAIGHT_DOWN_RAD, MovingLeaf, camera_points_at
from behaviours.ports import number
from uav_bt.board import CAMERA, FRAME, MARK, PHASE, STATE
from uav_bt.board.context import MissionContext
from uav_bt.errors import InputError, ValueRangeError
from uav_bt.lab.lab import Lab
from uav_bt.lab.shipped import default_mark
from uav_bt.plugins import make_mark_finder
from uav_bt.tree import Port, Status
from uav_bt.types import CameraModel, DroneState, LandingMark, MarkFix, MissionPhase, Velocity

_PITCH_SLACK_RAD: Final = math.radians(5)  # largest deviation from straight down
_WAIT_S: Final = 1.0  # without a detection for longer the drone climbs to see more
_MAX_HEIGHT_M: Final = 2.2  # above the ground: higher, only more box roofs come into view
_CONFIRMATIONS: Final = 2  # detections in a row within the tolerance that count as centred
_GAIN_PER_S: Final = 0.8  # speed per offset; stable with images up to 0.6 s late
_MAX_MPS: Final = 0.25
_HELD_S: Final = 0.3  # the velocity is held for this time without a new detection
# Least height above the mark of the second centring: lower, the view is too small for the mark.
_ABOVE_MARK_M: Final = 0.7
_HEADING_SLACK_RAD: Final = math.radians(3)  # largest deviation from the wanted heading; chosen
_ANY: Final = "any"


def _heading_rad(text: str) -> float | None:
    """Return the heading of the port's text; None for any."""
    if text == _ANY:
        return None
    try:
        heading_deg = float(text)
    except ValueError:
        heading_deg = math.nan
    if not -360.0 <= heading_deg <= 360.0:
        raise ValueRangeError(f"expected {_ANY}, or degrees from -360 to 360, got '{text}'")
    return math.radians(heading_deg)


HEADING: Final = Port(
    "heading_deg",
    str,
    default=_ANY,
    check=_heading_rad,
    doc="heading to land with, relative to the mark, clockwise, 0 towards its upper edge, "
    "degrees. any: as it is",
    at_setup=True,
)


class HelipadCenter(MovingLeaf):
    """Tilt the gimbal down, climb and centre the camera above the pad; FAILURE when it is lost.

    With `heading_deg` it also turns to a heading relative to the mark, which must show its heading,
    as tags do.
    """

    points = True
    group = "Landing"
    ports = (
        number("climb_m", 0.2, 0, 5, "how much to climb for a view of the pad, m"),
        number("low_m", 1.1, 0.3, 20, "second centring's height, m; at least 0.7 m above the mark"),
        number("tolerance_m", 0.04, 0.01, 1, "largest offset that counts as centred, m"),
        number("give_up_s", 20.0, 0, 3600, "seconds until it is lost, take-overs apart"),
        HEADING,
    )
    reads = (STATE, FRAME, CAMERA, MARK)
    writes = (PHASE,)

    def on_setup(self, mission: MissionContext) -> None:
        """Note the heights; raises InputError for a heading that the mark does not show."""
        super().on_setup(mission)
        self._low_m = mission.mark.height_m + _ABOVE_MARK_M
        self._heading_rad = _heading_rad(self.port_value("heading_deg"))
        if (message := self._refuses_mark(lambda: mission.mark)) is not None:
            raise InputError(f"HelipadCenter: {message}")

    def refuses_lab(self, lab: Callable[[], Lab]) -> str | None:
        """Refuse a heading where the lab's mark does not show one."""
        return self._refuses_mark(lambda: lab().mark or default_mark())

    def _refuses_mark(self, known: Callable[[], LandingMark]) -> str | None:
        text = self.initial_value(HEADING)
        if text is None or _heading_rad(text) is None:
            return None
        mark = known()
        if make_mark_finder(mark).shows_heading:
            return None
        return (
            f"heading_deg needs a landing mark that shows its heading, and one of kind "
            f"'{mark.kind}' does not: remove heading_deg, or use a tag"
        )

    def initialise(self) -> None:
        """Climb first."""
        self.write(PHASE, MissionPhase.CENTER)
        self._started_s = self.clock.now()
        self._gives_up_s = self.leaf_clock.now() + self.port_value("give_up_s")
        self._climb_next_m = self.port_value("climb_m")
        self._confirmed = 0
        self._judged_s = -math.inf
        self._course, self._steered_s = Velocity(), -math.inf
        self._low = False  # True while it centres the second time, lower down

    def gimbal_pitch_rad(self) -> float:
        """Return the pitch straight down."""
        return STRAIGHT_DOWN_RAD

    def work(self, state: DroneState) -> Status:
        """Continue the movement in progress, or judge the view and correct the offset."""
        if (answer := self.moved(state)) is not None:
            return answer
        if self._climb_next_m > 0.0:
            self.start_move(down_m=-self._climb_next_m)
            self._climb_next_m = 0.0
            return Status.RUNNING
        if self.leaf_clock.now() > self._gives_up_s:
            return self.fails(f"mark lost: not centred in {self.port_value('give_up_s'):g} s")
        fix, camera = self._fix_from_above(), self.read(CAMERA).value
        if fix is not None and camera is not None:
            return self._centre(state, fix, camera)
        return self._go_on_unseen(state)

    def _fix_from_above(self) -> MarkFix | None:
        """Return a new detection, looking straight down, since the last movement ended."""
        frame, fix = self.read(FRAME).value, self.read(MARK).value
        if frame is None or fix is None or not fix.detected:
            return None
        if fix.captured_s == self._judged_s:
            return None  # each frame is judged once
        down = camera_points_at(frame, STRAIGHT_DOWN_RAD, slack_rad=_PITCH_SLACK_RAD)
        return fix if down and fix.captured_s >= self._step.ended_s else None

    def _centre(self, state: DroneState, fix: MarkFix, camera: CameraModel) -> Status:
        self._judged_s = fix.captured_s
        turn_rad = 0.0
        if self._heading_rad is not None and fix.heading_deg is not None:
            turn_rad = math.remainder(self._heading_rad - math.radians(fix.heading_deg), math.tau)
        if abs(turn_rad) > _HEADING_SLACK_RAD:
            self._confirmed, self._steered_s = 0, -math.inf
            self.start_move(yaw_rad=turn_rad)
            return Status.RUNNING
        forward_m = fix.forward_m - camera.forward_offset_m
        offset_m = math.hypot(forward_m, fix.right_m)
        self.feedback_message = f"{100 * offset_m:.0f} cm off"
        per_s = min(_GAIN_PER_S, _MAX_MPS / max(offset_m, 1e-6))
        self._course = Velocity(forward_mps=per_s * forward_m, right_mps=per_s * fix.right_m)
        self._steered_s = self.clock.now()
        centred = offset_m <= self.port_value("tolerance_m")
        self._confirmed = self._confirmed + 1 if centred else 0
        if self._confirmed < _CONFIRMATIONS:
            self.propose(self._course)
            return Status.RUNNING
        if self._low:
            return Status.SUCCESS
        self._low, self._confirmed, self._steered_s = True, 0, -math.inf
        low_m = max(self.port_value("low_m"), self._low_m)
        self.start_move(down_m=state.height_above_ground_m - low_m)
        return Status.RUNNING

    def _go_on_unseen(self, state: DroneState) -> Status:
        """Hold the velocity until the next frame is due; then wait, and climb to see more."""
        if self.clock.now() - self._steered_s < _HELD_S:
            self.propose(self._course)
            return Status.RUNNING
        since_s = max(self._step.ended_s, self._started_s, self._judged_s)
        waited_s = self.clock.now() - max(since_s, self.leaf_clock.resumed_s)
        if waited_s > _WAIT_S and state.height_above_ground_m < _MAX_HEIGHT_M:
            self._low, self._confirmed = False, 0
            self.start_move(down_m=-self.port_value("climb_m"))
        return Status.RUNNING
