"""TakeOff: start the motors, climb to the flight height, point the camera."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from behaviours.fly.moving_leaf import MovingLeaf, camera_points_at
from behaviours.fly.step import Progress
from uav_bt.board import FLIGHT_HEIGHT, FLIGHT_PITCH, FRAME, PHASE, STATE
from uav_bt.mission.limits import Limits
from uav_bt.tree import Port, Status
from uav_bt.types import DroneState, FlyingState, MissionPhase
from uav_bt.types import TakeOff as TakeOffCommand


@dataclass(frozen=True, kw_only=True)
class TakeOffConfig:
    """When the flight height is reached."""

    height_slack_m: float = 0.1  # the mission's first advance corrects smaller errors


def above_ceiling(height_m: float) -> str | None:
    """Return a warning for a flight height above the default ceiling; else None."""
    ceiling_m = Limits().ceiling_m
    if height_m <= ceiling_m:
        return None
    return (
        f"{height_m:g} m lies above the ceiling of {ceiling_m:g} m: it flies only at a site whose "
        "limit ceiling_m is higher"
    )


class TakeOff(MovingLeaf):
    """Take off, climb to the flight height and point the camera; FAILURE when it takes too long."""

    points = True
    config: ClassVar[TakeOffConfig] = TakeOffConfig()
    repeats = True
    ports = (
        Port(
            "height_m",
            float,
            default=1.5,
            least=0.3,
            most=20,
            doc="flight height above the ground, m",
            caution=above_ceiling,
        ),
        Port(
            "gimbal_deg",
            float,
            default=-30.0,
            least=-90,
            most=90,
            doc="camera pitch in flight, degrees",
        ),
        Port(
            "give_up_s",
            float,
            default=20.0,
            least=0,
            most=3600,
            doc="seconds until it has failed, take-overs apart",
        ),
    )
    reads = (STATE, FRAME)
    writes = (PHASE, FLIGHT_HEIGHT, FLIGHT_PITCH)
    takes_off = True

    def initialise(self) -> None:
        """Write the mission's flight height and camera pitch, and note the time."""
        self.write(PHASE, MissionPhase.TAKE_OFF)
        self.write(FLIGHT_HEIGHT, self.port_value("height_m"))
        self.write(FLIGHT_PITCH, self.gimbal_pitch_rad())
        self._started_s = self.leaf_clock.now()

    def gimbal_pitch_rad(self) -> float:
        """Return the camera's pitch in flight."""
        return math.radians(self.port_value("gimbal_deg"))

    def work(self, state: DroneState) -> Status:
        """Propose the take-off, then the climb, then wait until the camera has its pitch."""
        if self.leaf_clock.now() - self._started_s > self.port_value("give_up_s"):
            self.feedback_message = f"still {state.flying.value}"
            return Status.FAILURE
        if state.flying not in {FlyingState.HOVERING, FlyingState.FLYING}:
            self.propose(TakeOffCommand())
            return Status.RUNNING
        if self.moving(state):
            return Status.RUNNING
        if self.progress is Progress.FAILED:
            self.feedback_message = self.trouble
            return Status.FAILURE
        error_m = state.height_above_ground_m - self.port_value("height_m")
        if abs(error_m) > self.config.height_slack_m:
            self.start_move(down_m=error_m)
            return Status.RUNNING
        points_ahead = camera_points_at(self.read(FRAME).value, self.gimbal_pitch_rad())
        return Status.SUCCESS if points_ahead else Status.RUNNING
