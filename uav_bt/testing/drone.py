"""A drone for tests, without physics or rendering, that records every command."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from uav_bt.clock import ManualClock
from uav_bt.errors import ValueRangeError
from uav_bt.types import (
    Airframe,
    Attitude,
    CameraModel,
    Command,
    CutMotors,
    DroneState,
    FlyingState,
    Frame,
    Land,
    MoveBy,
    MovementState,
    MovementStatus,
    Observation,
    TakeOff,
    Velocity,
    wrap_angle,
)

_STRIPE_GREY = 180


def pinhole(
    width_px: int = 64, height_px: int = 36, fov_rad: float = math.radians(69)
) -> CameraModel:
    """Return a small camera with the horizontal field of view of the ANAFI's video."""
    focal_px = width_px / 2 / math.tan(fov_rad / 2)
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


@dataclass(frozen=True, kw_only=True)
class ScriptedDroneConfig:
    """How the scripted drone answers."""

    movement_ticks: int = 3  # commands until a MoveBy is done; a tick is one command
    take_off_ticks: int = 5  # commands until it hovers
    landing_ticks: int = 5  # commands until the motors stop
    take_off_height_m: float = 1.0  # the ANAFI climbs to about a metre by itself
    tick_s: float = 0.1  # duration of one command of velocity piloting

    def __post_init__(self) -> None:
        if min(self.movement_ticks, self.take_off_ticks, self.landing_ticks) < 1:
            raise ValueRangeError(f"ticks must be 1 or more: {self}")

    def create(self) -> ScriptedDrone:
        """Return an unconnected drone with this configuration."""
        return ScriptedDrone(config=self)


class ScriptedDrone:
    """A `Drone` for tests.

    With `observations` it shows one of them per `observe`, and repeats the last. Without them it
    simulates an ideal drone: each movement is done exactly, after a number of ticks.
    """

    def __init__(
        self,
        observations: Iterable[Observation] = (),
        *,
        config: ScriptedDroneConfig | None = None,
        clock: ManualClock | None = None,
    ) -> None:
        self.config = config or ScriptedDroneConfig()
        self.clock = clock or ManualClock()
        self.camera = pinhole()
        self.airframe = Airframe()
        self.referee = None
        self.scene = None
        self.live = False
        self.tick_s = None
        self.connected = False
        self.commands: list[Command] = []  # all commands that were sent, in order
        self.x_m = 0.0  # world, relative to the take-off point
        self.y_m = 0.0
        self._script = list(observations)
        self._frames = 0
        self._ticks_left = 0
        self._move: MoveBy | None = None
        self.state = DroneState(captured_s=self.clock.now(), flying=FlyingState.LANDED)

    def connect(self) -> None:
        """Note the connection."""
        self.connected = True

    def disconnect(self) -> None:
        """Note that the connection has ended."""
        self.connected = False

    def observe(self) -> Observation:
        """Return the script's next observation, or the present state and a frame of stripes."""
        if self._script:
            return self._script.pop(0) if len(self._script) > 1 else self._script[0]
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
            self.state = replace(self.state, gimbal_pitch_rad=command.gimbal.pitch_rad)
        movement = command.movement
        if not isinstance(movement, MoveBy):
            self._interrupt()
        match movement:
            case CutMotors():
                self._set_height(0.0, FlyingState.LANDED)
            case TakeOff():
                self._take_off()
            case Land():
                self._land()
            case MoveBy():
                self._move_by(movement)
            case Velocity():
                self._fly(movement)
            case _ if self._airborne:
                self.state = replace(self.state, flying=FlyingState.HOVERING)
        return command

    @property
    def _airborne(self) -> bool:
        return self.state.flying in {FlyingState.HOVERING, FlyingState.FLYING}

    def _set_height(self, height_m: float, flying: FlyingState) -> None:
        self.state = replace(
            self.state,
            flying=flying,
            altitude_m=height_m,
            height_m=height_m,
            height_above_ground_m=height_m,
        )

    def _take_off(self) -> None:
        if self.state.flying is FlyingState.LANDED:
            self._begin(FlyingState.TAKING_OFF, self.config.take_off_ticks)
        if self.state.flying is FlyingState.TAKING_OFF and self._is_over():
            self._set_height(self.config.take_off_height_m, FlyingState.HOVERING)

    def _land(self) -> None:
        if self._airborne or self.state.flying is FlyingState.TAKING_OFF:
            self._begin(FlyingState.LANDING, self.config.landing_ticks)
        if self.state.flying is FlyingState.LANDING and self._is_over():
            self._set_height(0.0, FlyingState.LANDED)

    def _begin(self, flying: FlyingState, ticks: int) -> None:
        self._ticks_left = ticks
        self.state = replace(self.state, flying=flying)

    def _is_over(self) -> bool:
        self._ticks_left -= 1
        return self._ticks_left <= 0

    def _interrupt(self) -> None:
        if self._move is not None:
            self._report(self._move.id, MovementState.INTERRUPTED)
            self._move = None

    def _report(self, movement_id: int, state: MovementState) -> None:
        status = MovementStatus(id=movement_id, state=state)
        self.state = replace(self.state, movement=status)

    def _move_by(self, move: MoveBy) -> None:
        if not self._airborne:
            self._report(move.id, MovementState.REJECTED)
            return
        reported = self.state.movement
        if reported and reported.id == move.id and reported.state is not MovementState.RUNNING:
            return  # an ended movement is not flown again
        if self._move is None or self._move.id != move.id:
            self._interrupt()
            self._move = move
            self._begin(FlyingState.FLYING, self.config.movement_ticks)
            self._report(move.id, MovementState.RUNNING)
        if self._is_over():
            self._shift(move.forward_m, move.right_m, move.down_m, move.yaw_rad)
            self.state = replace(self.state, flying=FlyingState.HOVERING)
            self._report(move.id, MovementState.DONE)
            self._move = None

    def _fly(self, velocity: Velocity) -> None:
        if not self._airborne:
            return
        tick_s = self.config.tick_s
        self.state = replace(self.state, flying=FlyingState.FLYING)
        self._shift(
            velocity.forward_mps * tick_s,
            velocity.right_mps * tick_s,
            velocity.down_mps * tick_s,
            velocity.yaw_rate_radps * tick_s,
        )

    def _shift(self, forward_m: float, right_m: float, down_m: float, yaw_rad: float) -> None:
        heading = self.state.attitude.yaw_rad
        # Yaw is clockwise from +x, the world counter-clockwise: right of the heading is minus y.
        self.x_m += forward_m * math.cos(heading) - right_m * math.sin(heading)
        self.y_m -= forward_m * math.sin(heading) + right_m * math.cos(heading)
        self._set_height(max(0.0, self.state.height_m - down_m), self.state.flying)
        attitude = Attitude(yaw_rad=wrap_angle(heading + yaw_rad))
        self.state = replace(self.state, attitude=attitude)
