"""Commands in, accelerations out: what the ANAFI's own flight controller does for us."""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass

from sim_bridge.twin.airframe import CONTROL_STEP_S
from sim_bridge.twin.profile import Profile
from sim_bridge.twin.reference import Reference
from sim_bridge.twin.sensors import Estimate
from uav_bt.types import (
    CutMotors,
    FlyingState,
    Hover,
    Land,
    MoveBy,
    Movement,
    MovementState,
    MovementStatus,
    TakeOff,
    Velocity,
    rotate,
)

# Gains of the position loop: critically damped at 2 rad/s, well below the thrust's lag.
_POSITION_GAIN = 4.0  # 1/s2
_VELOCITY_GAIN = 4.0  # 1/s
_YAW_GAIN = 36.0  # 1/s2, critically damped at 6 rad/s
_YAW_RATE_GAIN = 12.0  # 1/s
_REACH_M = 0.5  # how far the reference may run ahead of the drone

_SETTLE_S = 0.2  # a movement is done once it has been at its goal for so long
_SETTLE_LIMIT_S = 3.0  # or so long after its reference arrived, in whatever wind
_SETTLED_M = 0.08
_SETTLED_MPS = 0.12
_SETTLED_RAD = 0.035

_DESCENT_MPS = 0.5  # landing speed, high up
_TOUCH_DOWN_MPS = 0.25  # and in the last half metre
_LOW_M = 0.5
_STANDING_S = 0.3  # ground contact for so long stops the motors


class Mode(enum.Enum):
    """What the autopilot is doing."""

    OFF = "off"
    SPIN_UP = "spin up"
    CLIMB = "climb"
    HOLD = "hold"
    MOVE = "move"
    VELOCITY = "velocity"
    DESCEND = "descend"
    FALL = "fall"


_FLYING = (Mode.HOLD, Mode.MOVE, Mode.VELOCITY)


@dataclass(frozen=True, kw_only=True, slots=True)
class Demand:
    """Accelerations asked of the airframe; world axes, yaw counter-clockwise."""

    acceleration_mps2: tuple[float, float, float]  # gravity not counted
    yaw_acceleration_radps2: float


class Autopilot:
    """Follows one movement command at a time."""

    def __init__(self, profile: Profile) -> None:
        self._profile = profile
        self._reference = Reference(profile, CONTROL_STEP_S)
        self._mode = Mode.OFF
        self._elapsed_s = 0.0  # in the present mode
        self._settled_s = 0.0
        self._arrived_s = 0.0
        self._goal = (0.0, 0.0, 0.0)
        self._goal_yaw_rad = 0.0
        self._velocity = Velocity()
        self._movement: MovementStatus | None = None

    @property
    def motors_on(self) -> bool:
        """Whether the rotors turn."""
        return self._mode not in (Mode.OFF, Mode.FALL)

    @property
    def lifting(self) -> bool:
        """Whether the rotors carry the drone (spinning up, they do not yet)."""
        return self.motors_on and self._mode is not Mode.SPIN_UP

    @property
    def movement(self) -> MovementStatus | None:
        """The state of the latest `MoveBy`."""
        return self._movement

    @property
    def flying_state(self) -> FlyingState:
        """The flying state as the ANAFI would report it."""
        if self._mode in _FLYING:
            still = self._mode is Mode.HOLD and max(map(abs, self._reference.velocity)) < 0.05
            return FlyingState.HOVERING if still else FlyingState.FLYING
        return {
            Mode.OFF: FlyingState.LANDED,
            Mode.SPIN_UP: FlyingState.TAKING_OFF,
            Mode.CLIMB: FlyingState.TAKING_OFF,
            Mode.DESCEND: FlyingState.LANDING,
            Mode.FALL: FlyingState.EMERGENCY,
        }[self._mode]

    def obey(self, movement: Movement, estimate: Estimate) -> None:
        """Take a command that has arrived.

        Args:
            movement: the command; what the drone is doing already is not begun again.
            estimate: where the drone believes to be.
        """
        if isinstance(movement, MoveBy):
            self._start_move(movement, estimate)
        elif isinstance(movement, Velocity):
            self._steer(movement)
        elif isinstance(movement, TakeOff):
            self._take_off(estimate)
        elif isinstance(movement, Land):
            self._land()
        elif isinstance(movement, CutMotors):
            if self._mode not in (Mode.OFF, Mode.FALL):
                self._enter(Mode.FALL)
        elif self._mode is Mode.VELOCITY or (
            self._mode is Mode.MOVE and isinstance(movement, Hover)
        ):
            # Released, nobody sends stick positions any more: to the drone the sticks are centred.
            self._enter(Mode.HOLD)

    def _take_off(self, estimate: Estimate) -> None:
        if self._mode is Mode.OFF:
            self._reference.reset(estimate.x_m, estimate.y_m, estimate.z_m, estimate.yaw_rad)
            self._enter(Mode.SPIN_UP)
        elif self._mode is Mode.DESCEND:
            self._enter(Mode.HOLD)

    def _land(self) -> None:
        if self._mode is Mode.SPIN_UP:
            self._enter(Mode.OFF)
        elif self.lifting and self._mode is not Mode.DESCEND:
            self._enter(Mode.DESCEND)

    def _steer(self, order: Velocity) -> None:
        if self._mode in _FLYING:
            self._velocity = order
            if self._mode is not Mode.VELOCITY:
                self._enter(Mode.VELOCITY)

    def take_over(self) -> None:
        """Let a pilot's centred sticks replace whatever was commanded."""
        if self._mode in (Mode.MOVE, Mode.VELOCITY):
            self._enter(Mode.HOLD)

    def refuse(self, move: MoveBy) -> None:
        """Answer a movement that may not be flown; one sent before keeps its state."""
        if self._movement is None or self._movement.id != move.id:
            self._movement = MovementStatus(id=move.id, state=MovementState.REJECTED)

    def _start_move(self, move: MoveBy, estimate: Estimate) -> None:
        if self._movement is not None and self._movement.id == move.id:
            return
        if self._mode not in _FLYING:
            self.refuse(move)
            return
        self._enter(Mode.MOVE)
        x_m, y_m = estimate.to_world(move.forward_m, -move.right_m)
        self._goal = (x_m, y_m, estimate.z_m - move.down_m)
        ahead = self._reference.yaw_error(estimate.yaw_rad)
        self._goal_yaw_rad = self._reference.yaw_rad - ahead - move.yaw_rad
        self._movement = MovementStatus(id=move.id, state=MovementState.RUNNING)

    def _enter(self, mode: Mode) -> None:
        running = self._movement is not None and self._movement.state is MovementState.RUNNING
        if self._movement is not None and running:
            self._movement = MovementStatus(id=self._movement.id, state=MovementState.INTERRUPTED)
        self._mode = mode
        self._elapsed_s = self._settled_s = self._arrived_s = 0.0

    def update(self, estimate: Estimate, *, height_m: float, touching: bool) -> Demand | None:
        """Move on by one control step.

        Args:
            estimate: where the drone believes to be.
            height_m: above the surface below.
            touching: whether the hull touches anything.

        Returns:
            What to ask of the airframe; None while the motors do not carry.
        """
        self._elapsed_s += CONTROL_STEP_S
        self._follow(estimate, height_m)
        self._finish(estimate, touching=touching)
        if not self.lifting:
            return None
        return self._demand(estimate)

    def _follow(self, estimate: Estimate, height_m: float) -> None:
        """Move the reference as the mode wants."""
        reference, profile = self._reference, self._profile
        if self._mode is Mode.CLIMB:
            there = reference.go_to(self._goal, profile.max_climb_mps, CONTROL_STEP_S)
            self._arrived_s += CONTROL_STEP_S if there else 0.0
        elif self._mode is Mode.HOLD:
            reference.steer(0.0, 0.0, 0.0, CONTROL_STEP_S)
            reference.spin(0.0, CONTROL_STEP_S)
        elif self._mode is Mode.MOVE:
            there = reference.go_to(self._goal, profile.max_climb_mps, CONTROL_STEP_S)
            turned = reference.turn_to(self._goal_yaw_rad, CONTROL_STEP_S)
            self._arrived_s += CONTROL_STEP_S if there and turned else 0.0
        elif self._mode is Mode.VELOCITY:
            order = self._velocity
            vx_mps, vy_mps = rotate(order.forward_mps, -order.right_mps, estimate.yaw_rad)
            reference.steer(vx_mps, vy_mps, -order.down_mps, CONTROL_STEP_S)
            reference.spin(-order.yaw_rate_radps, CONTROL_STEP_S)
        elif self._mode is Mode.DESCEND:
            speed = _DESCENT_MPS if height_m > _LOW_M else _TOUCH_DOWN_MPS
            reference.steer(0.0, 0.0, -min(speed, profile.max_climb_mps), CONTROL_STEP_S)
            reference.spin(0.0, CONTROL_STEP_S)
        if self._mode is not Mode.SPIN_UP:
            reference.trail()
            reference.keep_near(estimate.x_m, estimate.y_m, estimate.z_m, _REACH_M)

    def _finish(self, estimate: Estimate, *, touching: bool) -> None:
        """Go from one mode to the next where it has run its course."""
        if self._mode is Mode.SPIN_UP and self._elapsed_s >= self._profile.spin_up_s:
            self._goal = (
                estimate.x_m,
                estimate.y_m,
                estimate.z_m + self._profile.take_off_height_m,
            )
            self._reference.reset(estimate.x_m, estimate.y_m, estimate.z_m, estimate.yaw_rad)
            self._enter(Mode.CLIMB)
        elif self._mode in (Mode.CLIMB, Mode.MOVE):
            self._settle(estimate)
        elif self._mode in (Mode.DESCEND, Mode.FALL):
            speed = max(abs(estimate.vx_mps), abs(estimate.vy_mps), abs(estimate.vz_mps))
            standing = touching and speed < 0.15
            self._settled_s = self._settled_s + CONTROL_STEP_S if standing else 0.0
            if self._settled_s >= _STANDING_S:
                self._enter(Mode.OFF)

    def _settle(self, estimate: Estimate) -> None:
        gx, gy, gz = self._goal
        away = math.dist((gx, gy, gz), (estimate.x_m, estimate.y_m, estimate.z_m))
        speed = math.hypot(estimate.vx_mps, estimate.vy_mps, estimate.vz_mps)
        settled = away < _SETTLED_M and speed < _SETTLED_MPS
        if self._mode is Mode.MOVE:
            turning = abs(self._goal_yaw_rad - self._reference.yaw_rad)
            lagging = abs(self._reference.yaw_error(estimate.yaw_rad))
            settled = settled and turning + lagging < _SETTLED_RAD
        self._settled_s = self._settled_s + CONTROL_STEP_S if settled else 0.0
        if self._settled_s < _SETTLE_S and self._arrived_s < _SETTLE_LIMIT_S:
            return
        self._reference.settle(self._goal)
        if self._mode is Mode.MOVE and self._movement is not None:
            self._movement = MovementStatus(id=self._movement.id, state=MovementState.DONE)
        self._enter(Mode.HOLD)

    def _demand(self, estimate: Estimate) -> Demand:
        reference, profile = self._reference, self._profile
        here = (estimate.x_m, estimate.y_m, estimate.z_m)
        speed = (estimate.vx_mps, estimate.vy_mps, estimate.vz_mps)
        wanted = [
            reference.acceleration[axis]
            + _VELOCITY_GAIN * (reference.trailing_velocity[axis] - speed[axis])
            + _POSITION_GAIN * (reference.trailing[axis] - here[axis])
            for axis in range(3)
        ]
        # Corrections may ask for more than the reference does, but tilt is bounded.
        flat_limit = 2.0 * profile.max_acceleration_mps2
        flat = math.hypot(wanted[0], wanted[1])
        share = min(1.0, flat_limit / flat) if flat else 1.0
        rise_limit = 2.0 * profile.max_climb_acceleration_mps2
        rise = max(-rise_limit, min(rise_limit, wanted[2]))
        turn = _YAW_GAIN * reference.yaw_error(estimate.yaw_rad) + _YAW_RATE_GAIN * (
            reference.yaw_rate_radps - estimate.yaw_rate_radps
        )
        return Demand(
            acceleration_mps2=(wanted[0] * share, wanted[1] * share, rise),
            yaw_acceleration_radps2=turn,
        )
