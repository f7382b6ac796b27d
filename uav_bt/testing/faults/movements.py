"""Faults of movements: lost or changed commands, wrong reports, and exceptions."""

from __future__ import annotations

from dataclasses import replace
from typing import Never

from uav_bt.testing.faults.kind import FaultMoment, InjectedError, Send
from uav_bt.types import (
    Command,
    CutMotors,
    DroneState,
    MoveBy,
    Movement,
    MovementState,
    MovementStatus,
    Release,
    Velocity,
)


def raises(_seen: object, _at: FaultMoment) -> Never:
    """Raise."""
    raise InjectedError("the drone's SDK fell over")


def listener_raises() -> None:
    """Raise."""
    raise InjectedError("a display fell over")


def never_done(state: DroneState, _at: FaultMoment) -> DroneState:
    """Report every movement that is done as running."""
    moving = state.movement
    if moving is None or moving.state is not MovementState.DONE:
        return state
    return replace(state, movement=replace(moving, state=MovementState.RUNNING))


def interrupted(state: DroneState, at: FaultMoment) -> DroneState:
    """Report the latest movement as interrupted."""
    if at.command is None or not isinstance(at.command.movement, MoveBy):
        return state
    status = MovementStatus(id=at.command.movement.id, state=MovementState.INTERRUPTED)
    return replace(state, movement=status)


def instead(unwanted: type[Movement], movement: Movement) -> Send:
    """Return an effect that replaces commands of one kind by another movement."""

    def send(command: Command, _at: FaultMoment) -> Command:
        refused = isinstance(command.movement, unwanted)
        return replace(command, movement=movement) if refused else command

    return send


def unheard(_command: Command, _at: FaultMoment) -> Command:
    """Return the command of a drone that receives none."""
    return Command(movement=Release())


def unturned(command: Command, _at: FaultMoment) -> Command:
    """Return the command without its turn."""
    movement = command.movement
    if isinstance(movement, MoveBy):
        return replace(command, movement=replace(movement, yaw_rad=0.0))
    if isinstance(movement, Velocity):
        return replace(command, movement=replace(movement, yaw_rate_radps=0.0))
    return command


def cut(command: Command, at: FaultMoment) -> Command:
    """Return a cut of the motors for 0.5 s, then the command."""
    return Command(movement=CutMotors()) if at.since_s < 0.5 else command
