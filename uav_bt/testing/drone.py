"""A drone for tests, without physics or rendering, that records every command."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, Final

import numpy as np

from uav_bt.clock import ManualClock
from uav_bt.types import Airframe, CameraModel, DroneState, Frame, Observation, wrap_angle
from uav_bt.types.commands import Command, CutMotors, Land, MoveBy, TakeOff, Velocity
from uav_bt.types.drone_state import Attitude, FlyingState, MovementState, MovementStatus

_STRIPE_GREY: Final = 180
_TRANSITION_TICKS: Final = 5  # commands until a take-off or a landing is over
_TAKE_OFF_M: Final = 1.0  # the ANAFI climbs to about a metre by itself
_TICK_S: Final = 0.1  # of velocity piloting by one command
_AIRBORNE: Final = {FlyingState.HOVERING, FlyingState.FLYING}


def pinhole(width_px: int = 64, height_px: int = 36) -> CameraModel:
    """Return a small camera with the horizontal field of view of the ANAFI's video."""
    focal_px = width_px / 2 / math.tan(math.radians(69) / 2)
    return CameraModel(
        width_px=width_px,
        height_px=height_px,
        fx_px=focal_px,
        fy_px=focal_px,
        cx_px=(width_px - 1) / 2,
        cy_px=(height_px - 1) / 2,
    )


def blank_frame(
    camera: CameraModel, state: DroneState, *, index: int = 0, captured_s: float | None = None
) -> Frame:
    """Return a black frame with a state's telemetry, captured with it if no time is given."""
    return Frame(
        image=np.zeros((camera.height_px, camera.width_px, 3), dtype=np.uint8),
        index=index,
        captured_s=state.captured_s if captured_s is None else captured_s,
        gimbal_pitch_rad=state.gimbal_pitch_rad,
        attitude=state.attitude,
        altitude_m=state.altitude_m,
        height_m=state.height_m,
        height_above_ground_m=state.height_above_ground_m,
    )


class ScriptedDrone:
    """An ideal `Drone` for tests: a `MoveBy` is done exactly, after a number of commands."""

    def __init__(self, *, clock: ManualClock | None = None, movement_ticks: int = 3) -> None:
        self.clock = clock or ManualClock()
        self.camera = pinhole()
        self.airframe = Airframe()
        self.referee = self.scene = self.tick_s = None
        self.live = self.connected = False
        self.commands: list[Command] = []  # all commands that were sent, in order
        self.x_m = self.y_m = 0.0  # world, relative to the take-off point
        self.state = DroneState(captured_s=self.clock.now(), flying=FlyingState.LANDED)
        self._movement_ticks = movement_ticks
        self._ticks_left = 0
        self._move: MoveBy | None = None
        self._frames = 0

    def connect(self) -> None:
        """Note the connection."""
        self.connected = True

    def disconnect(self) -> None:
        """Note that the connection has ended."""
        self.connected = False

    def observe(self) -> Observation:
        """Return the present state and a frame of stripes."""
        self.state = self.state.dated(self.clock.now())
        frame = blank_frame(self.camera, self.state, index=self._frames)
        # They move: the runner takes an image that does not change in flight for a frozen video.
        stripes = (np.arange(self.camera.width_px) + self._frames) % 16 < 8
        frame.image[:, stripes] = _STRIPE_GREY
        self._frames += 1
        return Observation(frame=frame, state=self.state)

    def send(self, command: Command) -> Command:
        """Record the command and carry it out."""
        self.commands.append(command)
        if command.gimbal is not None:
            self._set(gimbal_pitch_rad=command.gimbal.pitch_rad)
        airborne = self.state.flying in _AIRBORNE
        movement = command.movement
        if not isinstance(movement, MoveBy):
            self._interrupt()
        match movement:
            case CutMotors():
                self._set_height(0.0, FlyingState.LANDED)
            case TakeOff():
                grounded = self.state.flying is FlyingState.LANDED
                self._go(FlyingState.TAKING_OFF, _TAKE_OFF_M, FlyingState.HOVERING, begins=grounded)
            case Land():
                flies = airborne or self.state.flying is FlyingState.TAKING_OFF
                self._go(FlyingState.LANDING, 0.0, FlyingState.LANDED, begins=flies)
            case MoveBy():
                self._move_by(movement, airborne=airborne)
            case Velocity() if airborne:
                self._set(flying=FlyingState.FLYING)
                self._shift(
                    _TICK_S * movement.forward_mps,
                    _TICK_S * movement.right_mps,
                    _TICK_S * movement.down_mps,
                    _TICK_S * movement.yaw_rate_radps,
                )
            case _ if airborne:
                self._set(flying=FlyingState.HOVERING)
        return command

    def _set(self, **changes: Any) -> None:
        self.state = replace(self.state, **changes)

    def _set_height(self, height_m: float, flying: FlyingState) -> None:
        heights = ("altitude_m", "height_m", "height_above_ground_m")
        self._set(flying=flying, **dict.fromkeys(heights, height_m))

    def _report(self, movement_id: int, state: MovementState) -> None:
        self._set(movement=MovementStatus(id=movement_id, state=state))

    def _go(self, through: FlyingState, to_m: float, end: FlyingState, *, begins: bool) -> None:
        """Take off or land, one command further."""
        if begins:
            self._set(flying=through)
            self._ticks_left = _TRANSITION_TICKS
        if self.state.flying is through:
            self._ticks_left -= 1
            if self._ticks_left <= 0:
                self._set_height(to_m, end)

    def _interrupt(self) -> None:
        if self._move is not None:
            self._report(self._move.id, MovementState.INTERRUPTED)
            self._move = None

    def _move_by(self, move: MoveBy, *, airborne: bool) -> None:
        if not airborne:
            self._report(move.id, MovementState.REJECTED)
            return
        reported = self.state.movement
        if reported and reported.id == move.id and reported.state is not MovementState.RUNNING:
            return  # an ended movement is not flown again
        if self._move is None or self._move.id != move.id:
            self._interrupt()
            self._move, self._ticks_left = move, self._movement_ticks
            self._set(flying=FlyingState.FLYING)
            self._report(move.id, MovementState.RUNNING)
        self._ticks_left -= 1
        if self._ticks_left <= 0:
            self._shift(move.forward_m, move.right_m, move.down_m, move.yaw_rad)
            self._set(flying=FlyingState.HOVERING)
            self._report(move.id, MovementState.DONE)
            self._move = None

    def _shift(self, forward_m: float, right_m: float, down_m: float, yaw_rad: float) -> None:
        heading = self.state.attitude.yaw_rad
        # Yaw is clockwise from +x, the world counter-clockwise: right of the heading is minus y.
        self.x_m += forward_m * math.cos(heading) - right_m * math.sin(heading)
        self.y_m -= forward_m * math.sin(heading) + right_m * math.cos(heading)
        self._set_height(max(0.0, self.state.height_m - down_m), self.state.flying)
        self._set(attitude=Attitude(yaw_rad=wrap_angle(heading + yaw_rad)))
