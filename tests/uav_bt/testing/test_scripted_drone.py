"""The scripted drone: a `Drone` without a world and with exact reactions."""

from __future__ import annotations

import math

import pytest

from uav_bt.testing import ScriptedDrone
from uav_bt.types import Command, FlyingState, Hover, MoveBy, MovementState, TakeOff


def flying() -> ScriptedDrone:
    drone = ScriptedDrone()
    while drone.observe().state.flying is not FlyingState.HOVERING:
        drone.send(Command(movement=TakeOff()))
    drone.commands.clear()
    return drone


def word(drone: ScriptedDrone) -> tuple[int, MovementState] | None:
    status = drone.observe().state.movement
    return (status.id, status.state) if status else None


def test_a_movement_ends_after_its_ticks() -> None:
    drone = flying()
    move = MoveBy(id=4, forward_m=1.0, down_m=-0.5, yaw_rad=math.pi / 2)
    words = []
    for _ in range(5):
        drone.send(Command(movement=move))
        words.append(word(drone))
    running, done = (4, MovementState.RUNNING), (4, MovementState.DONE)
    assert words == [running, running, done, done, done]
    assert (drone.x_m, drone.y_m) == pytest.approx((1.0, 0.0))
    assert drone.state.height_above_ground_m == pytest.approx(1.5)
    drone.send(Command(movement=MoveBy(id=5, forward_m=1.0)))
    for _ in range(2):
        drone.send(Command(movement=MoveBy(id=5, forward_m=1.0)))
    # Turned clockwise from +x, ahead is -y.
    assert (drone.x_m, drone.y_m) == pytest.approx((1.0, -1.0))


def test_a_new_movement_supersedes_and_anything_else_cancels() -> None:
    drone = flying()
    drone.send(Command(movement=MoveBy(id=1, forward_m=1.0)))
    drone.send(Command(movement=MoveBy(id=2, forward_m=1.0)))
    assert word(drone) == (2, MovementState.RUNNING)
    drone.send(Command(movement=Hover()))
    assert word(drone) == (2, MovementState.INTERRUPTED)
    assert drone.x_m == 0.0


def test_on_the_ground_movements_are_rejected_and_frames_are_of_now() -> None:
    drone = ScriptedDrone()
    drone.send(Command(movement=MoveBy(id=1, forward_m=1.0)))
    assert word(drone) == (1, MovementState.REJECTED)
    drone.clock.advance(0.1)
    frame = drone.observe().frame
    assert frame is not None
    assert frame.index == 1
    assert frame.captured_s == pytest.approx(0.1)
