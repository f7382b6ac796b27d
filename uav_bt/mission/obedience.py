"""A body that does not obey: what was commanded, held against what the drone reports it does."""

from __future__ import annotations

import math
from dataclasses import dataclass

from uav_bt.types import (
    Command,
    DroneState,
    FlyingState,
    Hover,
    Land,
    MoveBy,
    MovementState,
    TakeOff,
    Velocity,
)


@dataclass(frozen=True, kw_only=True)
class ObedienceConfig:
    """How long a drone may take before it counts as disobedient.

    Attributes:
        unheard_s: telemetry older than this is not held against it.
        start_s: until a gimbal points or a landing begins.
        movement_s: until a movement that goes on counts as one that does not end ...
        undone: ... so many of them in a row ...
        longest_s: ... or one that goes on for so long.
        gimbal_rad: how far the camera may point elsewhere.
        turned_share: of the turns that were commanded, at least so much must be seen ...
        turn_rad: ... counted over so much of turning.
        interruptions: movements in a row that end interrupted or rejected by the drone itself ...
        interrupted_s: ... from the first to the last over at least so long: a gust passes.
        drift_mps: mean speed of a drone that should hover ...
        drift_s: ... over so long.
    """

    unheard_s: float = 0.5
    start_s: float = 6.0
    movement_s: float = 4.0
    undone: int = 3
    longest_s: float = 40.0
    gimbal_rad: float = math.radians(6)
    turned_share: float = 0.3
    turn_rad: float = math.radians(150)
    interruptions: int = 6
    interrupted_s: float = 5.0
    drift_mps: float = 0.25
    drift_s: float = 4.0


class ObedienceWatch:
    """Compares commands with telemetry, tick by tick.

    Args:
        config: how long a drone may take.
    """

    def __init__(self, config: ObedienceConfig | None = None) -> None:
        self._config = config or ObedienceConfig()
        self._last_s: float | None = None
        self._yaw_rad = 0.0
        self._move: MoveBy | None = None
        self._since_s: dict[str, float] = {}  # since when something has not been as commanded
        self._asked_rad = self._turned_rad = 0.0
        self._ended = False  # whether the end of that movement was heard
        self._interrupted = self._undone = 0  # movements in a row
        self._gimbal_rad: float | None = None
        self._drift_m = [0.0, 0.0]
        self._hover_s = 0.0

    def complaint(self, command: Command, state: DroneState, now_s: float) -> str | None:
        """Return in what the drone does not obey, None while it does.

        Args:
            command: what was sent in this tick.
            state: telemetry of this tick.
            now_s: mission clock.
        """
        passed_s = 0.0 if self._last_s is None else now_s - self._last_s
        turned_rad = math.remainder(state.attitude.yaw_rad - self._yaw_rad, math.tau)
        self._last_s, self._yaw_rad = now_s, state.attitude.yaw_rad
        landing = self._landing(command, state, now_s)
        if landing is not None or now_s - state.captured_s > self._config.unheard_s:
            return landing  # old measurements say nothing about what it does now
        found = (
            self._movement(command, state, now_s),
            self._turning(command, passed_s, turned_rad),
            self._camera(command, state, now_s),
            self._drifting(command, state, passed_s),
        )
        return next((each for each in found if each is not None), None)

    def _lasts(self, what: str, now_s: float, *, holds: bool) -> float:
        """Return for how long something has held."""
        if not holds:
            self._since_s.pop(what, None)
            return 0.0
        return now_s - self._since_s.setdefault(what, now_s)

    def _landing(self, command: Command, state: DroneState, now_s: float) -> str | None:
        flies = state.flying in {FlyingState.HOVERING, FlyingState.FLYING}
        refused = isinstance(command.movement, Land) and flies
        if self._lasts("landing", now_s, holds=refused) > self._config.start_s:
            return "it does not land"
        grounded = isinstance(command.movement, TakeOff) and state.flying is FlyingState.LANDED
        if self._lasts("take-off", now_s, holds=grounded) > 2 * self._config.start_s:
            return "it does not take off"
        return None

    def _movement(self, command: Command, state: DroneState, now_s: float) -> str | None:
        """Complain of movements that the drone breaks off or never ends, several in a row."""
        move = command.movement if isinstance(command.movement, MoveBy) else None
        self._hear_of(self._move, state)
        interrupted_s = self._lasts("interrupted", now_s, holds=self._interrupted > 0)
        lasted_s = self._lasts("movement", now_s, holds=self._move is not None)
        if move is None or self._move is None or move.id != self._move.id:
            # A step that flows into the next is soon superseded; one that was waited for is not.
            unended = self._move is not None and not self._ended
            if unended and lasted_s > self._config.movement_s:
                self._undone += 1
            self._since_s.pop("movement", None)
            self._ended = False
        self._move = move
        config = self._config
        if self._interrupted >= config.interruptions and interrupted_s > config.interrupted_s:
            return f"{self._interrupted} movements in a row were interrupted"
        if self._undone >= config.undone or lasted_s > config.longest_s:
            return "its movements are not done"
        return None

    def _hear_of(self, move: MoveBy | None, state: DroneState) -> None:
        """Note the end of the movement that was commanded last."""
        status = state.movement
        if move is None or self._ended or status is None or status.id != move.id:
            return
        if status.state is MovementState.DONE:
            self._asked_rad += abs(move.yaw_rad)
            self._interrupted = self._undone = 0
        elif status.state is not MovementState.RUNNING:
            self._interrupted += 1
        self._ended = status.state is not MovementState.RUNNING

    def _turning(self, command: Command, passed_s: float, turned_rad: float) -> str | None:
        """Complain of a drone that does not turn; turns by `MoveBy` count when they are done."""
        if isinstance(command.movement, Velocity):
            self._asked_rad += abs(command.movement.yaw_rate_radps) * passed_s
        self._turned_rad += abs(turned_rad)
        if self._asked_rad < self._config.turn_rad:
            return None
        share = self._turned_rad / self._asked_rad
        self._asked_rad = self._turned_rad = 0.0
        return "it does not turn" if share < self._config.turned_share else None

    def _camera(self, command: Command, state: DroneState, now_s: float) -> str | None:
        if command.gimbal is not None:
            self._gimbal_rad = command.gimbal.pitch_rad
        if self._gimbal_rad is None:
            return None
        away = abs(state.gimbal_pitch_rad - self._gimbal_rad) > self._config.gimbal_rad
        if self._lasts("gimbal", now_s, holds=away) > self._config.start_s:
            return "its camera does not point where it should: is the gimbal stuck?"
        return None

    def _drifting(self, command: Command, state: DroneState, passed_s: float) -> str | None:
        """Complain of a drone that is carried away while it hovers."""
        if not isinstance(command.movement, Hover) or state.flying is not FlyingState.HOVERING:
            self._drift_m = [0.0, 0.0]
            self._hover_s = 0.0
            return None
        self._hover_s += passed_s
        self._drift_m[0] += state.velocity.forward_mps * passed_s
        self._drift_m[1] += state.velocity.right_mps * passed_s
        if self._hover_s < self._config.drift_s:
            return None
        speed_mps = math.hypot(*self._drift_m) / self._hover_s
        self._hover_s, self._drift_m = 0.0, [0.0, 0.0]
        if speed_mps <= self._config.drift_mps:
            return None
        return f"it drifts at {speed_mps:.2f} m/s while it should hover: is there wind?"
