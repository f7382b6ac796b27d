"""TakeOff: start the motors, climb to the flight height, point the camera."""

from __future__ import annotations

import math

from behaviours.fly.movement import MovingLeaf
from uav_bt.board import FLIGHT_HEIGHT, FRAME, PHASE, STATE
from uav_bt.tree import Port, Status
from uav_bt.types import DroneState, FlyingState, GimbalTo, MissionPhase
from uav_bt.types import TakeOff as TakeOffCommand

_AIRBORNE = frozenset({FlyingState.HOVERING, FlyingState.FLYING})
_HEIGHT_SLACK_M = 0.1
_PITCH_SLACK_RAD = math.radians(2)


class TakeOff(MovingLeaf):
    """Take off, climb to the flight height and point the camera; FAILURE when it takes too long."""

    ports = (
        Port("height_m", float, default=1.5, doc="flight height above the carpet, m"),
        Port("gimbal_deg", float, default=-30.0, doc="camera pitch in flight, degrees"),
        Port("give_up_s", float, default=20.0, doc="seconds until the take-off has failed"),
    )
    reads = (STATE, FRAME)
    writes = (PHASE, FLIGHT_HEIGHT)

    def initialise(self) -> None:
        """Set the height that the whole mission flies at, and note the time."""
        self.write(PHASE, MissionPhase.TAKE_OFF)
        self.write(FLIGHT_HEIGHT, self.port_value("height_m"))
        self._started_s = self.clock.now()

    def update(self) -> Status:
        """Ask for the take-off, then for the climb, then wait until the camera points ahead."""
        pitch_rad = math.radians(self.port_value("gimbal_deg"))
        status = self._work(pitch_rad)
        # A leaf that is done proposes nothing: the next one has the word in this very tick.
        if status is Status.RUNNING:
            self.point(GimbalTo(pitch_rad=pitch_rad))
        return status

    def _work(self, pitch_rad: float) -> Status:
        state, now_s = self.read(STATE).value, self.clock.now()
        if state is None:
            return Status.RUNNING
        if now_s - self._started_s > self.port_value("give_up_s"):
            self.feedback_message = f"still {state.flying.value}"
            return Status.FAILURE
        if state.flying not in _AIRBORNE:
            self.propose(TakeOffCommand())
            return Status.RUNNING
        return self._climb(state, pitch_rad)

    def _climb(self, state: DroneState, pitch_rad: float) -> Status:
        if self.moving(state):
            return Status.RUNNING
        error_m = state.height_above_carpet_m - self.port_value("height_m")
        if abs(error_m) > _HEIGHT_SLACK_M:
            self.start_move(down_m=error_m)
            return Status.RUNNING
        frame = self.read(FRAME).value
        points_ahead = frame and abs(frame.gimbal_pitch_rad - pitch_rad) < _PITCH_SLACK_RAD
        return Status.SUCCESS if points_ahead else Status.RUNNING
