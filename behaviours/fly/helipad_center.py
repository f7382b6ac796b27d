"""HelipadCenter: look straight down, climb a little, and bring the camera above the pad's centre.

It centres twice: from above, where the pad is sure to be in view, and again lower down, because the
drone drifts while it descends and the last descent, which is blind, should be short.
"""

from __future__ import annotations

import math

from behaviours.fly.movement import MovingLeaf
from uav_bt.board import CAMERA, FRAME, HELIPAD, PHASE, STATE
from uav_bt.tree import Port, Status
from uav_bt.types import CameraModel, DroneState, GimbalTo, HelipadFix, MissionPhase

_STRAIGHT_DOWN = GimbalTo(pitch_rad=-math.pi / 2)
_LOOKS_DOWN_RAD = math.radians(-85)
# Without a detection for this long at one height the drone climbs to see more.
_LOOK_S = 1.0
_CEILING_M = 2.2  # above the carpet: higher shows nothing more than the boxes' roofs
_CONFIRMATIONS = 2


class HelipadCenter(MovingLeaf):
    """Tilt the gimbal down, climb and centre the camera above the pad; FAILURE when it is lost."""

    ports = (
        Port("climb_m", float, default=0.2, doc="how much higher to look from, m"),
        Port("low_m", float, default=1.1, doc="height above the carpet of the second look, m"),
        Port("tolerance_m", float, default=0.04, doc="largest offset that counts as centred, m"),
        Port("give_up_s", float, default=20.0, doc="seconds until the pad counts as lost"),
    )
    reads = (STATE, FRAME, CAMERA, HELIPAD)
    writes = (PHASE,)

    def initialise(self) -> None:
        """Climb first."""
        self.write(PHASE, MissionPhase.CENTER)
        self._started_s = self.clock.now()
        self._climb_next_m = self.port_value("climb_m")
        self._confirmed = 0
        self._judged_s = -math.inf
        self._low = False  # the second look has begun

    def update(self) -> Status:
        """Go on with a movement in progress, or look and correct."""
        status = self._work()
        # A leaf that is done proposes nothing: the next one has the word in this very tick.
        if status is Status.RUNNING:
            self.point(_STRAIGHT_DOWN)
        return status

    def _work(self) -> Status:
        state, now_s = self.read(STATE).value, self.clock.now()
        if state is None:
            return Status.RUNNING
        if self.moving(state):
            return Status.RUNNING
        if self._climb_next_m > 0.0:
            self.start_move(down_m=-self._climb_next_m)
            self._climb_next_m = 0.0
            return Status.RUNNING
        if now_s - self._started_s > self.port_value("give_up_s"):
            self.feedback_message = "helipad lost"
            return Status.FAILURE
        fix, camera = self._fix_from_above(), self.read(CAMERA).value
        if fix is not None and camera is not None:
            return self._centre(state, fix, camera)
        return self._look_from_higher(state, now_s)

    def _fix_from_above(self) -> HelipadFix | None:
        """Return a detection made looking straight down since the last movement ended."""
        frame, fix = self.read(FRAME).value, self.read(HELIPAD).value
        if frame is None or fix is None or not fix.detected:
            return None
        if fix.captured_s == self._judged_s:
            return None  # a frame is looked at once
        looks_down = frame.gimbal_pitch_rad < _LOOKS_DOWN_RAD
        return fix if looks_down and fix.captured_s >= self._mover.ended_s else None

    def _centre(self, state: DroneState, fix: HelipadFix, camera: CameraModel) -> Status:
        self._judged_s = fix.captured_s
        forward_m = fix.forward_m - camera.forward_offset_m
        offset_m = math.hypot(forward_m, fix.right_m)
        self.feedback_message = f"{100 * offset_m:.0f} cm off"
        if offset_m > self.port_value("tolerance_m"):
            self._confirmed = 0
            self.start_move(forward_m=forward_m, right_m=fix.right_m)
            return Status.RUNNING
        self._confirmed += 1
        if self._confirmed < _CONFIRMATIONS:
            return Status.RUNNING
        if self._low:
            return Status.SUCCESS
        self._low, self._confirmed = True, 0
        self.start_move(down_m=state.height_above_carpet_m - self.port_value("low_m"))
        return Status.RUNNING

    def _look_from_higher(self, state: DroneState, now_s: float) -> Status:
        waited_s = now_s - max(self._mover.ended_s, self._started_s, self._judged_s)
        if waited_s > _LOOK_S and state.height_above_carpet_m < _CEILING_M:
            self._low, self._confirmed = False, 0
            self.start_move(down_m=-self.port_value("climb_m"))
        return Status.RUNNING
