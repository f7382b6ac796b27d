"""Flight controller of the twin: turns movement commands into accelerations, as the ANAFI does.

Each mode moves a reference point (`reference`); PD control makes the drone follow that point.
"""

from __future__ import annotations

import enum
import math
from typing import Final

from sim_bridge.twin.body import CONTROL_STEP_S, Motion
from sim_bridge.twin.profile import Profile
from sim_bridge.twin.reference import Pace, Reference
from uav_bt.types import (
    CutMotors,
    FlyingState,
    Hover,
    Land,
    MoveBy,
    Movement,
    MovementState,
    MovementStatus,
    Release,
    TakeOff,
    Velocity,
    rotate,
)
from uav_bt.types.pose import clamp, limit_length

# Gains of the position loop: critically damped at 2 rad/s, far below the bandwidth of the thrust.
_POSITION_GAIN: Final = 4.0  # 1/s2
_VELOCITY_GAIN: Final = 4.0  # 1/s
_YAW_GAIN: Final = 36.0  # 1/s2, critically damped at 6 rad/s
_YAW_RATE_GAIN: Final = 12.0  # 1/s

_REACH_M: Final = 0.5  # largest distance of the reference from the drone, each axis
_SETTLE_S: Final = 0.2  # a movement is done after this time at its goal
_MAX_SETTLE_S: Final = 3.0  # longest time from the reference's arrival to the end of a movement
_SETTLED_M: Final = 0.08  # distance from the goal that counts as at the goal
_SETTLED_MPS: Final = 0.12
_SETTLED_RAD: Final = 0.035
_HOVER_MPS: Final = 0.05  # reference speed below which the drone reports hovering
_DESCENT_MPS: Final = 0.5  # landing speed
_TOUCH_DOWN_MPS: Final = 0.25  # landing speed near the ground
_NEAR_GROUND_M: Final = 0.5
_STANDING_S: Final = 0.3  # the motors stop after this time of ground contact
_STANDING_MPS: Final = 0.15  # largest vertical speed of a drone on the ground
# Largest estimated horizontal speed on the ground; the estimate of a standing drone drifts.
_STANDING_FLAT_MPS: Final = 0.5


class Mode(enum.Enum):
    """Mode of the autopilot."""

    OFF = "off"
    SPIN_UP = "spin up"
    CLIMB = "climb"
    HOLD = "hold"
    MOVE = "move"
    VELOCITY = "velocity"
    DESCEND = "descend"
    FALL = "fall"


_FLYING: Final = (Mode.HOLD, Mode.MOVE, Mode.VELOCITY)
_REPORTED: Final = {
    Mode.OFF: FlyingState.LANDED,
    Mode.SPIN_UP: FlyingState.TAKING_OFF,
    Mode.CLIMB: FlyingState.TAKING_OFF,
    Mode.HOLD: FlyingState.HOVERING,  # flying until the reference is slow
    Mode.MOVE: FlyingState.FLYING,
    Mode.VELOCITY: FlyingState.FLYING,
    Mode.DESCEND: FlyingState.LANDING,
    Mode.FALL: FlyingState.EMERGENCY,
}


class Autopilot:
    """Executes one movement command at a time, within the limits of a profile."""

    def __init__(self, profile: Profile) -> None:
        self._profile = profile
        self._reference = Reference(profile)
        self._full_pace = self._pace = Pace(
            speed_mps=profile.max_speed_mps,
            climb_mps=profile.max_climb_mps,
            yaw_rate_radps=profile.max_yaw_rate_radps,
        )
        self._mode = Mode.OFF
        self._elapsed_s = 0.0  # time in the present mode
        self._settled_s = 0.0
        self._arrived_s = 0.0
        self._goal_m = (0.0, 0.0, 0.0)  # world x, y, z
        self._goal_yaw_rad = 0.0
        self._velocity = Velocity()
        self.movement: MovementStatus | None = None  # status of the latest `MoveBy`

    @property
    def motors_on(self) -> bool:
        """Whether the rotors turn."""
        return self._mode not in (Mode.OFF, Mode.FALL)

    @property
    def lifting(self) -> bool:
        """Whether the rotors carry the drone; false while they spin up."""
        return self.motors_on and self._mode is not Mode.SPIN_UP

    @property
    def flying_state(self) -> FlyingState:
        """The flying state, as the ANAFI reports it."""
        slow = max(map(abs, self._reference.velocity)) < _HOVER_MPS
        if self._mode is Mode.HOLD and not slow:
            return FlyingState.FLYING
        return _REPORTED[self._mode]

    def obey(self, movement: Movement, estimate: Motion, pace: Pace | None = None) -> None:
        """Execute a command that has arrived; one that is being executed does not start again.

        A pace limits a `MoveBy`; by default the profile does.
        """
        mode = self._mode
        match movement:
            case MoveBy():
                self._start_move(movement, estimate, pace or self._full_pace)
            case Velocity() if mode in _FLYING:
                self._velocity = movement
                self._enter(Mode.VELOCITY)
            case TakeOff() if mode is Mode.OFF:
                self._enter(Mode.SPIN_UP)
            case TakeOff() if mode is Mode.DESCEND:
                self._enter(Mode.HOLD)
            case Land() if mode is Mode.SPIN_UP:
                self._enter(Mode.OFF)
            case Land() if self.lifting and mode is not Mode.DESCEND:
                self._enter(Mode.DESCEND)
            case CutMotors() if self.motors_on:
                self._enter(Mode.FALL)
            case Hover() if mode in (Mode.MOVE, Mode.VELOCITY):
                self._enter(Mode.HOLD)
            case Release() if mode is Mode.VELOCITY:
                # Without stick positions the drone treats the sticks as centred.
                self._enter(Mode.HOLD)

    def _start_move(self, move: MoveBy, estimate: Motion, pace: Pace) -> None:
        if self.movement is not None and self.movement.id == move.id:
            return
        if self._mode not in _FLYING:
            self.movement = MovementStatus(id=move.id, state=MovementState.REJECTED)
            return
        self._enter(Mode.MOVE)
        self._pace = pace
        x_m, y_m = estimate.to_world(move.forward_m, -move.right_m)
        self._goal_m = (x_m, y_m, estimate.z_m - move.down_m)
        ahead = self._reference.yaw_error(estimate.yaw_rad)
        self._goal_yaw_rad = self._reference.yaw_rad - ahead - move.yaw_rad
        self.movement = MovementStatus(id=move.id, state=MovementState.RUNNING)

    def _enter(self, mode: Mode) -> None:
        if self.movement is not None and self.movement.state is MovementState.RUNNING:
            self.movement = MovementStatus(id=self.movement.id, state=MovementState.INTERRUPTED)
        self._mode = mode
        self._elapsed_s = self._settled_s = self._arrived_s = 0.0

    def update(
        self, estimate: Motion, *, height_m: float, touching: bool
    ) -> tuple[tuple[float, float, float], float] | None:
        """Advance by one control step, at a height above the surface below.

        Returns:
            The acceleration to produce, m/s2, world axes, without gravity, and the yaw
            acceleration, rad/s2; None while the rotors do not carry the drone.
        """
        self._elapsed_s += CONTROL_STEP_S
        if self.lifting:
            self._move_reference(estimate, height_m)
        self._finish(estimate, touching=touching)
        return self._demand(estimate) if self.lifting else None

    def _move_reference(self, estimate: Motion, height_m: float) -> None:
        reference, arrived = self._reference, False
        if self._mode is Mode.CLIMB:
            arrived = reference.go_to(self._goal_m, self._full_pace)
        elif self._mode is Mode.MOVE:
            there = reference.go_to(self._goal_m, self._pace)
            arrived = reference.turn_to(self._goal_yaw_rad, self._pace) and there
        elif self._mode is Mode.VELOCITY:
            order = self._velocity
            vx_mps, vy_mps = rotate(order.forward_mps, -order.right_mps, estimate.yaw_rad)
            reference.steer(vx_mps, vy_mps, -order.down_mps)
            reference.spin(-order.yaw_rate_radps)
        elif self._mode is Mode.DESCEND:
            down_mps = _DESCENT_MPS if height_m > _NEAR_GROUND_M else _TOUCH_DOWN_MPS
            reference.steer(0.0, 0.0, -min(down_mps, self._profile.max_climb_mps))
            reference.spin(0.0)
        else:
            reference.steer(0.0, 0.0, 0.0)
            reference.spin(0.0)
        if arrived:
            self._arrived_s += CONTROL_STEP_S
        reference.trail()
        reference.keep_near(estimate, _REACH_M)

    def _finish(self, estimate: Motion, *, touching: bool) -> None:
        """Change the mode if the present one has ended."""
        if self._mode is Mode.SPIN_UP and self._elapsed_s >= self._profile.spin_up_s:
            top_m = estimate.z_m + self._profile.take_off_height_m
            self._goal_m = (estimate.x_m, estimate.y_m, top_m)
            self._reference.reset(estimate)
            self._enter(Mode.CLIMB)
        elif self._mode in (Mode.CLIMB, Mode.MOVE):
            self._settle(estimate)
        elif self._mode in (Mode.DESCEND, Mode.FALL):
            flat_mps = max(abs(estimate.vx_mps), abs(estimate.vy_mps))
            still = abs(estimate.vz_mps) < _STANDING_MPS and flat_mps < _STANDING_FLAT_MPS
            self._settled_s = self._settled_s + CONTROL_STEP_S if touching and still else 0.0
            if self._settled_s >= _STANDING_S:
                self._enter(Mode.OFF)

    def _settle(self, estimate: Motion) -> None:
        """End a climb or a movement whose goal is reached."""
        away_m = math.dist(self._goal_m, (estimate.x_m, estimate.y_m, estimate.z_m))
        speed_mps = math.hypot(estimate.vx_mps, estimate.vy_mps, estimate.vz_mps)
        settled = away_m < _SETTLED_M and speed_mps < _SETTLED_MPS
        if self._mode is Mode.MOVE:
            turning = abs(self._goal_yaw_rad - self._reference.yaw_rad)
            lagging = abs(self._reference.yaw_error(estimate.yaw_rad))
            settled = settled and turning + lagging < _SETTLED_RAD
        self._settled_s = self._settled_s + CONTROL_STEP_S if settled else 0.0
        if self._settled_s < _SETTLE_S and self._arrived_s < _MAX_SETTLE_S:
            return
        self._reference.settle(self._goal_m)
        if self._mode is Mode.MOVE and self.movement is not None:
            self.movement = MovementStatus(id=self.movement.id, state=MovementState.DONE)
        self._enter(Mode.HOLD)

    def _demand(self, estimate: Motion) -> tuple[tuple[float, float, float], float]:
        """Return the accelerations that make the drone follow its reference, as `update` does."""
        reference, profile = self._reference, self._profile
        here = (estimate.x_m, estimate.y_m, estimate.z_m)
        speed = (estimate.vx_mps, estimate.vy_mps, estimate.vz_mps)
        x_mps2, y_mps2, z_mps2 = (
            reference.acceleration[axis]
            + _VELOCITY_GAIN * (reference.trailing_velocity[axis] - speed[axis])
            + _POSITION_GAIN * (reference.trailing[axis] - here[axis])
            for axis in range(3)
        )
        # Corrections may exceed the limits of the reference, but the tilt stays bounded.
        flat = limit_length(x_mps2, y_mps2, 2.0 * profile.max_acceleration_mps2)
        rise = clamp(z_mps2, 2.0 * profile.max_climb_acceleration_mps2)
        turn = _YAW_GAIN * reference.yaw_error(estimate.yaw_rad) + _YAW_RATE_GAIN * (
            reference.yaw_rate_radps - estimate.yaw_rate_radps
        )
        return (*flat, rise), turn
