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
        start_s: until a movement is reported, a gimbal points, or a landing begins.
        speed_mps: the slowest mean speed of a movement ...
        yaw_rate_radps: ... and of a turn.
        gimbal_rad: how far the camera may point elsewhere.
        turned_share: of the turns that were commanded, at least so much must be seen ...
        turn_rad: ... counted over so much of turning.
        interruptions: movements in a row that end interrupted or rejected by the drone itself.
        drift_mps: mean speed of a drone that was told to hover ...
        drift_s: ... over so long.
    """

    start_s: float = 6.0
    speed_mps: float = 0.08
    yaw_rate_radps: float = 0.15
    gimbal_rad: float = math.radians(6)
    turned_share: float = 0.3
    turn_rad: float = math.radians(150)
    interruptions: int = 6
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
        self._interrupted = 0
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
        found = (
            self._landing(command, state, now_s),
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
        """Complain of a movement that is not heard of or takes too long, or of many broken off."""
        move = command.movement if isinstance(command.movement, MoveBy) else None
        if move is None or self._move is None or move.id != self._move.id:
            self._since_s.pop("movement", None)
            self._ended = False
        self._move = move
        if move is None:
            return None
        status = state.movement
        word = MovementState.RUNNING if status is None or status.id != move.id else status.state
        if word is not MovementState.RUNNING and not self._ended:
            self._ended = True
            done = word is MovementState.DONE
            self._asked_rad += abs(move.yaw_rad) if done else 0.0
            self._interrupted = 0 if done else self._interrupted + 1
        config = self._config
        if self._interrupted >= config.interruptions:
            return f"{self._interrupted} movements in a row were interrupted"
        way_m = math.hypot(move.forward_m, move.right_m, move.down_m)
        turn_s = abs(move.yaw_rad) / config.yaw_rate_radps
        most_s = config.start_s + way_m / config.speed_mps + turn_s
        if self._lasts("movement", now_s, holds=not self._ended) > most_s:
            turn_deg = math.degrees(move.yaw_rad)
            return f"a movement of {way_m:.1f} m and {turn_deg:.0f} deg is not done"
        return None

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
