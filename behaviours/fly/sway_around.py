"""SwayAround: turn once around and move from side to side, so that every view has parallax."""

from __future__ import annotations

import math
from typing import Any, ClassVar

from behaviours.fly.leaf_clock import LeafClock
from uav_bt.board import PHASE, STATE, Key
from uav_bt.board.context import MissionContext
from uav_bt.tree import Leaf, Port, Status
from uav_bt.types import GimbalTo, MissionPhase, Pose2D, Velocity, rotate
from uav_bt.types.dead_reckoning import Odometry

_GAIN_PER_S = 0.8  # of position and heading errors; chosen, well below the drone's delays


class SwayAround(Leaf):
    """Turn once around while moving from side to side; SUCCESS after the turn.

    A turn alone shows no distance: frames at different places do. The drone stays within `sway_m`
    of the place where the leaf began. The camera changes between two pitches from one period to
    the next. No map is needed, so the leaf works in an unknown place; the free room
    around the take-off place must suffice.
    """

    answers: ClassVar[tuple[Status, ...]] = (Status.SUCCESS, Status.RUNNING)
    moves = True
    points = True
    ports: ClassVar[tuple[Port[Any], ...]] = (
        Port("seconds", float, default=30.0, least=8, most=600, doc="time of the whole turn, s"),
        Port("sway_m", float, default=0.2, least=0.05, most=1, doc="way to either side, m"),
        Port("period_s", float, default=3.0, least=1, most=60, doc="time of one sway, s"),
        Port(
            "gimbal_deg",
            float,
            default=-36.0,
            least=-90,
            most=90,
            doc="camera pitch for the ground, degrees",
        ),
        Port(
            "level_deg",
            float,
            default=-10.0,
            least=-90,
            most=90,
            doc="camera pitch for the horizon, degrees",
        ),
    )
    reads: ClassVar[tuple[Key[Any], ...]] = (STATE,)
    writes = (PHASE,)

    def on_setup(self, mission: MissionContext) -> None:
        """Make the clock."""
        self._leaf_clock = LeafClock(mission.clock)

    def initialise(self) -> None:
        """Begin where the drone is."""
        self.write(PHASE, MissionPhase.LOOK)
        self._odometry = Odometry()
        self._began_s: float | None = None
        self._origin = Pose2D(x_m=0.0, y_m=0.0, yaw_rad=0.0)

    def update(self) -> Status:
        """Propose the velocity of this moment, and the camera's pitch."""
        paused_s = self._leaf_clock.tick()
        state = self.read(STATE).value
        if state is None:
            return Status.RUNNING
        pose = self._odometry.update(state, self.clock.now())
        if self._began_s is None:
            self._began_s, self._origin = self._leaf_clock.now(), pose
        passed_s = self._leaf_clock.now() - self._began_s
        if passed_s >= self.port_value("seconds"):
            return Status.SUCCESS
        wanted, velocity = self._course(passed_s)
        if paused_s > 0.0:
            # A pilot has moved the drone: it goes on from there.
            self._origin = Pose2D(
                x_m=self._origin.x_m + pose.x_m - wanted.x_m,
                y_m=self._origin.y_m + pose.y_m - wanted.y_m,
                yaw_rad=self._origin.yaw_rad + pose.yaw_rad - wanted.yaw_rad,
            )
            wanted, velocity = self._course(passed_s)
        forward_mps, right_mps = rotate(
            velocity.forward_mps + _GAIN_PER_S * (wanted.x_m - pose.x_m),
            velocity.right_mps + _GAIN_PER_S * (wanted.y_m - pose.y_m),
            -pose.yaw_rad,
        )
        off_rad = math.remainder(wanted.yaw_rad - pose.yaw_rad, 2.0 * math.pi)
        self.propose(
            Velocity(
                forward_mps=forward_mps,
                right_mps=right_mps,
                yaw_rate_radps=velocity.yaw_rate_radps + _GAIN_PER_S * off_rad,
            )
        )
        self.point(GimbalTo(pitch_rad=math.radians(self._pitch_deg(passed_s))))
        return Status.RUNNING

    def _course(self, passed_s: float) -> tuple[Pose2D, Velocity]:
        """Return the pose at a time, and its rate along the axes of the odometry."""
        seconds, sway_m = self.port_value("seconds"), self.port_value("sway_m")
        turn_radps = 2.0 * math.pi / seconds
        phase_radps = 2.0 * math.pi / self.port_value("period_s")
        yaw_rad = self._origin.yaw_rad + turn_radps * passed_s
        aside_m = sway_m * math.sin(phase_radps * passed_s)
        aside_mps = sway_m * phase_radps * math.cos(phase_radps * passed_s)
        x_m, y_m = rotate(0.0, aside_m, yaw_rad)
        x_mps, y_mps = rotate(-turn_radps * aside_m, aside_mps, yaw_rad)
        wanted = Pose2D(x_m=self._origin.x_m + x_m, y_m=self._origin.y_m + y_m, yaw_rad=yaw_rad)
        return wanted, Velocity(forward_mps=x_mps, right_mps=y_mps, yaw_rate_radps=turn_radps)

    def _pitch_deg(self, passed_s: float) -> float:
        level = int(passed_s / self.port_value("period_s")) % 2 == 0
        pitch_deg: float = self.port_value("level_deg" if level else "gimbal_deg")
        return pitch_deg

    def terminate(self, new_status: Status) -> None:
        """Stop the clock."""
        del new_status
        self._leaf_clock.stop()
