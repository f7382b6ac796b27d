"""Take-off and changes of height: TakeOff and ClimbTo."""

from __future__ import annotations

import math
from typing import Any, ClassVar, Final

from behaviours.fly.moving_leaf import MovingLeaf, camera_points_at
from behaviours.ports import number
from uav_bt.board import FLIGHT_HEIGHT, FLIGHT_PITCH, FRAME, PHASE, STATE
from uav_bt.board.blackboard import Key
from uav_bt.mission.limits import Limits
from uav_bt.tree import Port, Status
from uav_bt.types import DroneState, FlyingState, MissionPhase
from uav_bt.types import TakeOff as TakeOffCommand

_SLACK_M: Final = 0.1  # smaller errors in height are corrected by the mission's first advance


def above_ceiling(height_m: float) -> str | None:
    """Return a warning for a flight height above the default ceiling; else None."""
    ceiling_m = Limits().ceiling_m
    above = f"{height_m:g} m lies above the ceiling of {ceiling_m:g} m"
    only = "it flies only at a site whose limit ceiling_m is higher"
    return f"{above}: {only}" if height_m > ceiling_m else None


_HEIGHT: Final = 0.3, 20.0, "flight height above the ground, m"  # range and text of the port


class ClimbTo(MovingLeaf):
    """Climb or sink to another flight height; SUCCESS there.

    The leaves after it keep that height. FAILURE after repeated attempts without progress.
    """

    repeats = True
    ports: ClassVar[tuple[Port[Any], ...]] = (
        number("height_m", None, *_HEIGHT, caution=above_ceiling),
    )
    reads: ClassVar[tuple[Key[Any], ...]] = (STATE,)
    writes: ClassVar[tuple[Key[Any], ...]] = (PHASE, FLIGHT_HEIGHT)
    phase: ClassVar[MissionPhase] = MissionPhase.GO_TO

    def initialise(self) -> None:
        """Write the mission's flight height."""
        self.write(PHASE, self.phase)
        self.write(FLIGHT_HEIGHT, self.port_value("height_m"))

    def work(self, state: DroneState) -> Status:
        """Climb or sink until the height is reached."""
        if (answer := self.moved(state)) is not None:
            return answer
        too_high_m = state.height_above_ground_m - self.port_value("height_m")
        if abs(too_high_m) <= _SLACK_M:
            return self.at_height()
        self.start_move(down_m=too_high_m)
        return Status.RUNNING

    def at_height(self) -> Status:
        """Return the answer at the height."""
        return Status.SUCCESS


class TakeOff(ClimbTo):
    """Take off, climb to the flight height and point the camera; FAILURE when it takes too long."""

    points = True
    ports = (
        number("height_m", 1.5, *_HEIGHT, caution=above_ceiling),
        number("gimbal_deg", -30.0, -90, 90, "camera pitch in flight, degrees"),
        number("give_up_s", 20.0, 0, 3600, "seconds until it has failed, take-overs apart"),
    )
    reads = (STATE, FRAME)
    writes = (PHASE, FLIGHT_HEIGHT, FLIGHT_PITCH)
    takes_off = True
    phase = MissionPhase.TAKE_OFF

    def initialise(self) -> None:
        """Write the mission's flight height and camera pitch, and note the time."""
        super().initialise()
        self.write(FLIGHT_PITCH, self.gimbal_pitch_rad())
        self._started_s = self.leaf_clock.now()

    def gimbal_pitch_rad(self) -> float:
        """Return the camera's pitch in flight."""
        return math.radians(self.port_value("gimbal_deg"))

    def work(self, state: DroneState) -> Status:
        """Propose the take-off, then the climb, then wait until the camera has its pitch."""
        if self.leaf_clock.now() - self._started_s > self.port_value("give_up_s"):
            return self.fails(f"still {state.flying.value}")
        if state.flying not in {FlyingState.HOVERING, FlyingState.FLYING}:
            self.propose(TakeOffCommand())
            return Status.RUNNING
        return super().work(state)

    def at_height(self) -> Status:
        """Wait until a frame was captured at the camera's pitch."""
        points_ahead = camera_points_at(self.read(FRAME).value, self.gimbal_pitch_rad())
        return Status.SUCCESS if points_ahead else Status.RUNNING
