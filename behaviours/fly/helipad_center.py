"""HelipadCenter: point the camera straight down, climb a little, and centre it above the pad.

The leaf centres twice: high up, where the pad is in view, and again lower down. The drone drifts
while it descends, and the last descent, which is blind, should be short. Centring is position-based
visual servoing (Chaumette and Hutchinson, 2006): a velocity in proportion to the camera's offset,
updated on every frame. Steps would not converge in gusts: each ends some centimetres off.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar, Final

from behaviours.fly.moving_leaf import STRAIGHT_DOWN_RAD, MovingLeaf, camera_points_at
from behaviours.fly.step import Progress
from uav_bt.board import CAMERA, FRAME, MARK, PHASE, STATE
from uav_bt.board.context import MissionContext
from uav_bt.errors import InputError, ValueRangeError
from uav_bt.lab.lab import Lab
from uav_bt.lab.shipped import default_mark
from uav_bt.plugins import make_mark_finder
from uav_bt.tree import Port, Status
from uav_bt.types import CameraModel, DroneState, LandingMark, MarkFix, MissionPhase, Velocity


@dataclass(frozen=True, kw_only=True)
class CenterConfig:
    """When a view counts, and when to climb for a wider one."""

    pitch_slack_rad: float = math.radians(5)  # largest deviation from straight down
    wait_s: float = 1.0  # time without a detection after which the drone climbs to see more
    max_height_m: float = 2.2  # above the ground: higher, only more box roofs come into view
    confirmations: int = 2  # detections in a row within the tolerance that count as centred
    gain_per_s: float = 0.8  # speed per offset; stable with images up to 0.6 s late
    max_mps: float = 0.25
    held_s: float = 0.3  # the velocity is held for this time without a new detection
    # Least height above the mark of the second centring: lower, the view is too small for the mark.
    above_mark_m: float = 0.7
    heading_slack_rad: float = math.radians(3)  # largest deviation from the wanted heading. Chosen.


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
    config: ClassVar[CenterConfig] = CenterConfig()
    ports = (
        Port(
            "climb_m",
            float,
            default=0.2,
            least=0,
            most=5,
            doc="how much to climb for a view of the pad, m",
        ),
        Port(
            "low_m",
            float,
            default=1.1,
            least=0.3,
            most=20,
            doc="height above the ground of the second centring, m; at least 0.7 m above the mark",
        ),
        Port(
            "tolerance_m",
            float,
            default=0.04,
            least=0.01,
            most=1,
            doc="largest offset that counts as centred, m",
        ),
        Port(
            "give_up_s",
            float,
            default=20.0,
            least=0,
            most=3600,
            doc="seconds until it is lost, take-overs apart",
        ),
        HEADING,
    )
    reads = (STATE, FRAME, CAMERA, MARK)
    writes = (PHASE,)

    def on_setup(self, mission: MissionContext) -> None:
        """Note the mark's height and the heading to land with.

        Raises:
            InputError: A heading is wanted, but the mark does not show its heading.
        """
        super().on_setup(mission)
        self._low_m = mission.mark.height_m + self.config.above_mark_m
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
        if self.moving(state):
            return Status.RUNNING
        if self.progress is Progress.FAILED:
            self.feedback_message = self.trouble
            return Status.FAILURE
        if self._climb_next_m > 0.0:
            self.start_move(down_m=-self._climb_next_m)
            self._climb_next_m = 0.0
            return Status.RUNNING
        if self.leaf_clock.now() > self._gives_up_s:
            self.feedback_message = "mark lost"
            return Status.FAILURE
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
        down = camera_points_at(frame, STRAIGHT_DOWN_RAD, slack_rad=self.config.pitch_slack_rad)
        return fix if down and fix.captured_s >= self._step.ended_s else None

    def _centre(self, state: DroneState, fix: MarkFix, camera: CameraModel) -> Status:
        self._judged_s = fix.captured_s
        turn_rad = self._turn_to(fix)
        if abs(turn_rad) > self.config.heading_slack_rad:
            self._confirmed, self._steered_s = 0, -math.inf
            self.start_move(yaw_rad=turn_rad)
            return Status.RUNNING
        forward_m = fix.forward_m - camera.forward_offset_m
        offset_m = math.hypot(forward_m, fix.right_m)
        self.feedback_message = f"{100 * offset_m:.0f} cm off"
        self._course, self._steered_s = self._towards(forward_m, fix.right_m), self.clock.now()
        centred = offset_m <= self.port_value("tolerance_m")
        self._confirmed = self._confirmed + 1 if centred else 0
        if self._confirmed < self.config.confirmations:
            self.propose(self._course)
            return Status.RUNNING
        if self._low:
            return Status.SUCCESS
        self._low, self._confirmed, self._steered_s = True, 0, -math.inf
        low_m = max(self.port_value("low_m"), self._low_m)
        self.start_move(down_m=state.height_above_ground_m - low_m)
        return Status.RUNNING

    def _turn_to(self, fix: MarkFix) -> float:
        """Return the turn to the wanted heading, clockwise; 0 without one or an unknown heading."""
        if self._heading_rad is None or fix.heading_deg is None:
            return 0.0
        return math.remainder(self._heading_rad - math.radians(fix.heading_deg), math.tau)

    def _towards(self, forward_m: float, right_m: float) -> Velocity:
        """Return the velocity that brings the camera above the pad."""
        cfg, offset_m = self.config, math.hypot(forward_m, right_m)
        per_s = min(cfg.gain_per_s, cfg.max_mps / max(offset_m, 1e-6))
        return Velocity(forward_mps=per_s * forward_m, right_mps=per_s * right_m)

    def _go_on_unseen(self, state: DroneState) -> Status:
        """Hold the velocity until the next frame is due; then wait, and climb to see more."""
        if self.clock.now() - self._steered_s < self.config.held_s:
            self.propose(self._course)
            return Status.RUNNING
        since_s = max(self._step.ended_s, self._started_s, self._judged_s)
        waited_s = self.clock.now() - max(since_s, self.leaf_clock.resumed_s)
        if waited_s > self.config.wait_s and state.height_above_ground_m < self.config.max_height_m:
            self._low, self._confirmed = False, 0
            self.start_move(down_m=-self.port_value("climb_m"))
        return Status.RUNNING
