"""Flight controller of the twin: turns movement commands into accelerations, as the ANAFI does.

This module holds the modes and their transitions. Each mode moves a reference point (`reference`);
the control law (`control_law`) makes the drone follow that point.
"""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass

from sim_bridge.twin.body import CONTROL_STEP_S
from sim_bridge.twin.control_law import Demand, demand
from sim_bridge.twin.profile import Profile
from sim_bridge.twin.reference import Pace, Reference
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


@dataclass(frozen=True, kw_only=True)
class AutopilotConfig:
    """Thresholds at which a mode ends, and speeds of a landing."""

    reach_m: float = 0.5  # largest distance of the reference from the drone, each axis
    settle_s: float = 0.2  # a movement is done after this time at its goal
    max_settle_s: float = 3.0  # longest time from the reference's arrival to the end of a movement
    settled_m: float = 0.08  # distance from the goal that counts as at the goal
    settled_mps: float = 0.12
    settled_rad: float = 0.035
    hover_mps: float = 0.05  # reference speed below which the drone reports hovering
    descent_mps: float = 0.5  # landing speed
    touch_down_mps: float = 0.25  # landing speed near the ground
    near_ground_m: float = 0.5
    standing_s: float = 0.3  # the motors stop after this time of ground contact
    standing_mps: float = 0.15  # largest vertical speed of a drone on the ground
    # Largest estimated horizontal speed on the ground; the estimate of a standing drone drifts.
    standing_flat_mps: float = 0.5


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


_FLYING = (Mode.HOLD, Mode.MOVE, Mode.VELOCITY)


class Autopilot:
    """Executes one movement command at a time.

    Args:
        profile: the drone's limits.
        config: thresholds.
    """

    def __init__(self, profile: Profile, config: AutopilotConfig | None = None) -> None:
        self._profile = profile
        self._config = config or AutopilotConfig()
        self._reference = Reference(profile, CONTROL_STEP_S)
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
        if self._mode in _FLYING:
            if self._mode is not Mode.HOLD:
                return FlyingState.FLYING
            slow = max(map(abs, self._reference.velocity)) < self._config.hover_mps
            return FlyingState.HOVERING if slow else FlyingState.FLYING
        return {
            Mode.OFF: FlyingState.LANDED,
            Mode.SPIN_UP: FlyingState.TAKING_OFF,
            Mode.CLIMB: FlyingState.TAKING_OFF,
            Mode.DESCEND: FlyingState.LANDING,
            Mode.FALL: FlyingState.EMERGENCY,
        }[self._mode]

    def obey(self, movement: Movement, estimate: Estimate, pace: Pace | None = None) -> None:
        """Execute a command that has arrived.

        Args:
            movement: the command; a command that is already being executed does not start again.
            estimate: the drone's estimate of its pose and velocity.
            pace: speed limits of a `MoveBy`; None uses the limits of the profile.
        """
        if isinstance(movement, MoveBy):
            self._start_move(movement, estimate, pace or self._full_pace)
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
            # Without stick positions the drone treats the sticks as centred.
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
        """Replace the present command by the centred sticks of a pilot."""
        if self._mode in (Mode.MOVE, Mode.VELOCITY):
            self._enter(Mode.HOLD)

    def refuse(self, move: MoveBy) -> None:
        """Report a movement as rejected; one that was reported before keeps its state."""
        if self.movement is None or self.movement.id != move.id:
            self.movement = MovementStatus(id=move.id, state=MovementState.REJECTED)

    def _start_move(self, move: MoveBy, estimate: Estimate, pace: Pace) -> None:
        if self.movement is not None and self.movement.id == move.id:
            return
        if self._mode not in _FLYING:
            self.refuse(move)
            return
        self._enter(Mode.MOVE)
        self._pace = pace
        x_m, y_m = estimate.to_world(move.forward_m, -move.right_m)
        self._goal_m = (x_m, y_m, estimate.z_m - move.down_m)
        ahead = self._reference.yaw_error(estimate.yaw_rad)
        self._goal_yaw_rad = self._reference.yaw_rad - ahead - move.yaw_rad
        self.movement = MovementStatus(id=move.id, state=MovementState.RUNNING)

    def _enter(self, mode: Mode) -> None:
        running = self.movement is not None and self.movement.state is MovementState.RUNNING
        if self.movement is not None and running:
            self.movement = MovementStatus(id=self.movement.id, state=MovementState.INTERRUPTED)
        self._mode = mode
        self._elapsed_s = self._settled_s = self._arrived_s = 0.0

    def update(self, estimate: Estimate, *, height_m: float, touching: bool) -> Demand | None:
        """Advance by one control step.

        Args:
            estimate: the drone's estimate of its pose and velocity.
            height_m: height above the surface below.
            touching: whether the hull touches anything.

        Returns:
            The accelerations to produce; None while the rotors do not carry the drone.
        """
        self._elapsed_s += CONTROL_STEP_S
        self._follow(estimate, height_m)
        self._finish(estimate, touching=touching)
        if not self.lifting:
            return None
        return demand(self._reference, estimate, self._profile)

    def _follow(self, estimate: Estimate, height_m: float) -> None:
        """Move the reference according to the mode."""
        reference, profile, cfg = self._reference, self._profile, self._config
        if self._mode is Mode.CLIMB:
            there = reference.go_to(self._goal_m, self._full_pace, CONTROL_STEP_S)
            self._arrived_s += CONTROL_STEP_S if there else 0.0
        elif self._mode is Mode.HOLD:
            reference.steer(0.0, 0.0, 0.0, CONTROL_STEP_S)
            reference.spin(0.0, CONTROL_STEP_S)
        elif self._mode is Mode.MOVE:
            there = reference.go_to(self._goal_m, self._pace, CONTROL_STEP_S)
            turned = reference.turn_to(self._goal_yaw_rad, self._pace, CONTROL_STEP_S)
            self._arrived_s += CONTROL_STEP_S if there and turned else 0.0
        elif self._mode is Mode.VELOCITY:
            order = self._velocity
            vx_mps, vy_mps = rotate(order.forward_mps, -order.right_mps, estimate.yaw_rad)
            reference.steer(vx_mps, vy_mps, -order.down_mps, CONTROL_STEP_S)
            reference.spin(-order.yaw_rate_radps, CONTROL_STEP_S)
        elif self._mode is Mode.DESCEND:
            speed = cfg.descent_mps if height_m > cfg.near_ground_m else cfg.touch_down_mps
            reference.steer(0.0, 0.0, -min(speed, profile.max_climb_mps), CONTROL_STEP_S)
            reference.spin(0.0, CONTROL_STEP_S)
        if self._mode is not Mode.SPIN_UP:
            reference.trail()
            reference.keep_near(estimate.x_m, estimate.y_m, estimate.z_m, self._config.reach_m)

    def _finish(self, estimate: Estimate, *, touching: bool) -> None:
        """Change the mode if the present one has ended."""
        if self._mode is Mode.SPIN_UP and self._elapsed_s >= self._profile.spin_up_s:
            top_m = estimate.z_m + self._profile.take_off_height_m
            self._goal_m = (estimate.x_m, estimate.y_m, top_m)
            self._reference.reset(estimate.x_m, estimate.y_m, estimate.z_m, estimate.yaw_rad)
            self._enter(Mode.CLIMB)
        elif self._mode in (Mode.CLIMB, Mode.MOVE):
            self._settle(estimate)
        elif self._mode in (Mode.DESCEND, Mode.FALL):
            flat_mps = max(abs(estimate.vx_mps), abs(estimate.vy_mps))
            still = abs(estimate.vz_mps) < self._config.standing_mps
            standing = touching and still and flat_mps < self._config.standing_flat_mps
            self._settled_s = self._settled_s + CONTROL_STEP_S if standing else 0.0
            if self._settled_s >= self._config.standing_s:
                self._enter(Mode.OFF)

    def _settle(self, estimate: Estimate) -> None:
        cfg = self._config
        away = math.dist(self._goal_m, (estimate.x_m, estimate.y_m, estimate.z_m))
        speed = math.hypot(estimate.vx_mps, estimate.vy_mps, estimate.vz_mps)
        settled = away < cfg.settled_m and speed < cfg.settled_mps
        if self._mode is Mode.MOVE:
            turning = abs(self._goal_yaw_rad - self._reference.yaw_rad)
            lagging = abs(self._reference.yaw_error(estimate.yaw_rad))
            settled = settled and turning + lagging < cfg.settled_rad
        self._settled_s = self._settled_s + CONTROL_STEP_S if settled else 0.0
        if self._settled_s < cfg.settle_s and self._arrived_s < cfg.max_settle_s:
            return
        self._reference.settle(self._goal_m)
        if self._mode is Mode.MOVE and self.movement is not None:
            self.movement = MovementStatus(id=self.movement.id, state=MovementState.DONE)
        self._enter(Mode.HOLD)
