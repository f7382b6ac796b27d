"""A rehearsal: a real camera and a simulated flight."""

from __future__ import annotations

import math

import pytest

from uav_bt.app.drone_of_flight import RehearsedDrone
from uav_bt.clock import ManualClock
from uav_bt.protocols import Drone
from uav_bt.testing import ScriptedDrone
from uav_bt.types import (
    Command,
    CutMotors,
    DroneState,
    FlyingState,
    GimbalTo,
    Hover,
    Land,
    MoveBy,
    Movement,
    MovementState,
    Observation,
    Release,
    TakeOff,
    Velocity,
)


class Held:
    """A drone in a person's hands that records its commands."""

    referee = None
    camera = None
    live = True

    def __init__(self) -> None:
        self.clock = ManualClock()
        self.told: list[Command] = []

    def connect(self) -> None:
        return

    def disconnect(self) -> None:
        return

    def observe(self) -> Observation:
        state = DroneState(captured_s=self.clock.now(), flying=FlyingState.LANDED, battery=0.7)
        return Observation(frame=None, state=state)

    def send(self, command: Command) -> Command:
        self.told.append(command)
        return command


class Stage:
    def __init__(self) -> None:
        self.held = Held()
        self.drone = RehearsedDrone(self.held)  # type: ignore[arg-type]
        self.drone.connect()

    def play(self, movement: Movement, seconds: float) -> DroneState:
        """Send a movement for some time and return the last state."""
        clock = self.held.clock
        end_s = clock.now() + seconds
        while clock.now() < end_s:
            self.drone.observe()
            self.drone.send(Command(movement=movement))
            clock.advance(0.1)
        return self.drone.observe().state

    def fly(self) -> None:
        assert self.play(TakeOff(), 3.5).flying is FlyingState.HOVERING


def test_the_drone_gets_only_camera_directions() -> None:
    assert isinstance(RehearsedDrone(ScriptedDrone()), Drone)
    stage = Stage()
    assert stage.drone.live
    stage.fly()
    for movement in (MoveBy(id=1, forward_m=1.0), Velocity(forward_mps=1.0), Land(), CutMotors()):
        command = Command(movement=movement, gimbal=GimbalTo(pitch_rad=-0.5))
        assert stage.drone.send(command) == command
    assert stage.held.told == [Command(movement=Release(), gimbal=GimbalTo(pitch_rad=-0.5))] * 4


def test_a_pretended_flight_has_heights_and_ends() -> None:
    stage = Stage()
    stage.fly()
    assert stage.play(Hover(), 0.2).altitude_m == pytest.approx(1.0)
    up = stage.play(MoveBy(id=1, down_m=-0.5), 2.0)
    assert up.movement is not None
    assert (up.movement.id, up.movement.state) == (1, MovementState.DONE)
    assert up.altitude_m == pytest.approx(1.5)
    assert up.battery == 0.7
    sinking = stage.play(Velocity(down_mps=0.5), 1.0)
    assert sinking.flying is FlyingState.FLYING
    assert sinking.altitude_m == pytest.approx(1.0, abs=0.06)
    down = stage.play(Land(), 3.5)
    assert (down.flying, down.altitude_m) == (FlyingState.LANDED, 0.0)


def test_a_movement_takes_its_time_and_can_be_interrupted() -> None:
    stage = Stage()
    stage.fly()
    running = stage.play(MoveBy(id=5, yaw_rad=math.pi), 1.0)
    assert running.movement is not None
    assert running.movement.state is MovementState.RUNNING
    hovering = stage.play(Hover(), 0.2)
    assert hovering.movement is not None
    assert hovering.movement.state is MovementState.INTERRUPTED
    assert hovering.flying is FlyingState.HOVERING


def test_on_the_ground_only_a_take_off_counts() -> None:
    stage = Stage()
    for movement in (Hover(), MoveBy(id=1, forward_m=1.0), Velocity(forward_mps=1.0), Land()):
        assert stage.play(movement, 0.3).flying is FlyingState.LANDED
