"""A rehearsal: live video and telemetry, and a drone that stays where it is.

The mission flies a pretended drone: it takes off, moves and lands in numbers only, at once and
without error, so that tree and perception run as they would. The gimbal is pointed for real, since
the view depends on it. A person holds the drone at flight height and watches the decisions of the
mission.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

from uav_bt.mission.drone_wrapper import DroneWrapper
from uav_bt.protocols import Drone
from uav_bt.types import (
    Command,
    CutMotors,
    DroneState,
    FlyingState,
    Frame,
    Hover,
    Land,
    MoveBy,
    MovementState,
    MovementStatus,
    Observation,
    Release,
    TakeOff,
    Velocity,
)

_TAKE_OFF_S: Final = 3.0  # time in which an ANAFI climbs to 1 m
_TAKE_OFF_M: Final = 1.0
_LANDING_S: Final = 3.0
_PACE_MPS: Final = 0.5
_PACE_RADPS: Final = 0.8


@dataclass(frozen=True, kw_only=True)
class _Pretence:
    flying: FlyingState = FlyingState.LANDED
    until_s: float = math.inf  # end of the present movement
    altitude_m: float = 0.0
    climb_mps: float = 0.0
    move: MoveBy | None = None
    status: MovementStatus | None = None
    last_s: float | None = None


class RehearsedDrone(DroneWrapper):
    """Watches through another drone and commands nothing but its gimbal."""

    def __init__(self, drone: Drone) -> None:
        """Keep the drone; it is connected when this one is."""
        super().__init__(drone)
        self._now = _Pretence()

    @property
    def referee(self) -> None:
        """There is no truth about a pretended flight."""
        return

    @property
    def stills(self) -> None:
        """A rehearsal takes no photographs: it commands nothing but the gimbal."""
        return

    def connect(self) -> None:
        """Connect the inner drone; nothing was pretended yet.

        Raises:
            DroneError: it cannot be reached.
        """
        self._now = _Pretence()
        self._drone.connect()

    def observe(self) -> Observation:
        """Return the drone's observation, at the pretended height."""
        seen = self._drone.observe()
        self._pass_time(self.clock.now())
        return Observation(
            frame=None if seen.frame is None else self._raised(seen.frame),
            state=self._pretended(seen.state),
        )

    def send(self, command: Command) -> Command:
        """Pretend to obey; point the camera. Return the command as it would be sent."""
        self._obey(command.movement, self.clock.now())
        if command.gimbal is not None:
            sent = self._drone.send(Command(movement=Release(), gimbal=command.gimbal))
            return replace(command, gimbal=sent.gimbal)
        return command

    def _raised(self, frame: Frame) -> Frame:
        raised_m = self._now.altitude_m
        return replace(
            frame,
            altitude_m=frame.altitude_m + raised_m,
            height_m=frame.height_m + raised_m,
            height_above_ground_m=frame.height_above_ground_m + raised_m,
        )

    def _pretended(self, state: DroneState) -> DroneState:
        raised_m = self._now.altitude_m
        velocity, climb_mps = state.velocity, self._now.climb_mps
        return replace(
            state,
            velocity=replace(velocity, down_mps=velocity.down_mps - climb_mps),
            flying=self._now.flying,
            movement=self._now.status,
            altitude_m=state.altitude_m + raised_m,
            height_m=state.height_m + raised_m,
            height_above_ground_m=state.height_above_ground_m + raised_m,
        )

    def _pass_time(self, now_s: float) -> None:
        now = self._now
        step_s = 0.0 if now.last_s is None else now_s - now.last_s
        height_m = max(0.0, now.altitude_m + step_s * now.climb_mps)
        self._now = now = replace(now, last_s=now_s, altitude_m=height_m)
        if now_s < now.until_s:
            return
        rest = replace(now, until_s=math.inf, flying=FlyingState.HOVERING)
        if now.flying is FlyingState.TAKING_OFF:
            self._now = replace(rest, altitude_m=_TAKE_OFF_M)
        elif now.flying is FlyingState.LANDING:
            self._now = replace(rest, flying=FlyingState.LANDED, altitude_m=0.0)
        elif now.move is not None:
            self._now = replace(
                rest,
                altitude_m=max(0.0, now.altitude_m - now.move.down_m),
                move=None,
                status=MovementStatus(id=now.move.id, state=MovementState.DONE),
            )

    def _obey(self, movement: object, now_s: float) -> None:
        now = self._now
        flies = now.flying in {FlyingState.HOVERING, FlyingState.FLYING}
        if isinstance(movement, TakeOff) and now.flying is FlyingState.LANDED:
            self._now = replace(now, flying=FlyingState.TAKING_OFF, until_s=now_s + _TAKE_OFF_S)
        elif isinstance(movement, Land) and flies:
            self._now = replace(
                self._stopped(), flying=FlyingState.LANDING, until_s=now_s + _LANDING_S
            )
        elif isinstance(movement, CutMotors):
            self._now = replace(self._stopped(), flying=FlyingState.LANDED, altitude_m=0.0)
        elif isinstance(movement, MoveBy) and flies:
            self._start(movement, now_s)
        elif isinstance(movement, Velocity) and flies:
            self._now = replace(
                self._stopped(), flying=FlyingState.FLYING, climb_mps=-movement.down_mps
            )
        elif isinstance(movement, Hover | Release) and flies:
            self._now = replace(self._stopped(), flying=FlyingState.HOVERING)

    def _start(self, move: MoveBy, now_s: float) -> None:
        if self._now.status is not None and self._now.status.id == move.id:
            return
        length_m = math.hypot(move.forward_m, move.right_m, move.down_m)
        self._now = replace(
            self._stopped(),
            flying=FlyingState.FLYING,
            until_s=now_s + length_m / _PACE_MPS + abs(move.yaw_rad) / _PACE_RADPS,
            move=move,
            status=MovementStatus(id=move.id, state=MovementState.RUNNING),
        )

    def _stopped(self) -> _Pretence:
        """Return the present pretence with nothing under way."""
        now = self._now
        status = now.status
        if now.move is not None:
            status = MovementStatus(id=now.move.id, state=MovementState.INTERRUPTED)
        return replace(now, until_s=math.inf, climb_mps=0.0, move=None, status=status)
