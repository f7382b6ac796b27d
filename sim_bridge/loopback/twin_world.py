"""The twin as a loopback ANAFI's world: its physics by the wall clock, on a thread of its own."""

from __future__ import annotations

import math
import threading
from collections import deque
from dataclasses import dataclass, replace
from typing import Final

from sim_bridge.loopback.world import WorldLimits, WorldState
from sim_bridge.twin.gl import load_mujoco
from sim_bridge.twin.profile import Profile
from sim_bridge.twin.scene import ROOM_SIZE_M, Scene
from sim_bridge.twin.start import start_pose
from uav_bt.errors import DroneError
from uav_bt.protocols import Clock
from uav_bt.types import Command, FlyingState, GimbalTo, Hover, Movement, Pose

load_mujoco()  # before the modules below do: how it draws is settled at its import

from sim_bridge.loopback.field import FIELD, build_field, field_profile  # noqa: E402
from sim_bridge.twin.airframe import CONTROL_STEP_S  # noqa: E402
from sim_bridge.twin.model import LabModel, build_model  # noqa: E402
from sim_bridge.twin.simulation import Capture, Simulation  # noqa: E402

__all__ = ["TwinWorld"]

_PERIOD_S: Final = 0.02  # s between two rounds of physics: two of the twin's control steps
_MAX_LAG_S: Final = 0.25  # s that physics may be late before the lost time is given up
_LIFTED_M: Final = 0.03  # m above where it stood: it flies
_BELOW_CEILING_M: Final = 0.8  # m that a drone keeps from the lab's ceiling


@dataclass(frozen=True, kw_only=True, slots=True)
class _Base:
    """What is measured from: where the drone stood last."""

    z_m: float  # true
    altitude_m: float  # as the twin's sensors said


class TwinWorld:
    """A `World` of MuJoCo in real time; start it, fly, stop it."""

    def __init__(self, scene: Scene | None, *, profile: Profile, seed: int, clock: Clock) -> None:
        """Build the lab; time does not pass before `start`.

        Args:
            scene: the lab; None is the open field.
            profile: limits and imperfections; in the field the limits are wider.
            seed: of everything random.
            clock: what paces the physics.

        Raises:
            MissingDependencyError: MuJoCo or OpenGL does not work here.
        """
        # Computing takes real time here: none is charged for it.
        profile = replace(profile, compute_latency_s=0.0)
        self.scene = FIELD if scene is None else scene
        self.profile = field_profile(profile) if scene is None else profile
        self.lab: LabModel = build_field() if scene is None else build_model(scene)
        self.start_pose: Pose = start_pose(self.scene, seed)
        self._simulation = Simulation(self.scene, self.lab, self.profile, seed, self.start_pose)
        self._limits = WorldLimits(
            max_speed_mps=self.profile.max_speed_mps,
            max_climb_mps=self.profile.max_climb_mps,
            max_yaw_rate_radps=self.profile.max_yaw_rate_radps,
            ceiling_m=(
                math.inf
                if scene is None
                else ROOM_SIZE_M[2] - self.start_pose.z_m - _BELOW_CEILING_M
            ),
        )
        self._clock = clock
        self._inbox: deque[Command] = deque()
        self._movement: Movement = Hover()
        self._base = _Base(z_m=self.start_pose.z_m, altitude_m=0.0)
        self._offset_s = 0.0  # of the clock over the simulation's time
        self._lost_s = 0.0
        self._failure: Exception | None = None
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None
        self._state = self._look()

    @property
    def limits(self) -> WorldLimits:
        """What the body can do."""
        return self._limits

    @property
    def lost_s(self) -> float:
        """How much time was given up because the machine was too slow."""
        return self._lost_s

    def start(self) -> None:
        """Let time pass."""
        if self._thread is None:
            self._offset_s = self._clock.now() - self._simulation.now_s
            self._thread = threading.Thread(target=self._run, name="twin-world", daemon=True)
            self._thread.start()

    def stop(self) -> None:
        """Let time stand still for good; safe to call twice."""
        self._stop.set()
        if self._thread is not None:
            self._thread.join()

    def state(self) -> WorldState:
        """Return the newest state.

        Raises:
            DroneError: the simulation failed.
        """
        if self._failure is not None:
            raise DroneError(f"the simulation failed: {self._failure}") from self._failure
        return self._state

    def move(self, movement: Movement) -> None:
        """Order a movement."""
        if movement != self._movement:
            self._movement = movement
            self._inbox.append(Command(movement=movement))

    def point(self, pitch_rad: float) -> None:
        """Turn the camera."""
        # The movement that is under way comes along; told again, it changes nothing.
        self._inbox.append(Command(movement=self._movement, gimbal=GimbalTo(pitch_rad=pitch_rad)))

    def newest_capture(self, age_s: float) -> tuple[Capture, float] | None:
        """Return the newest picture to draw that is so old, and when it was taken by the clock.

        Args:
            age_s: how old at least; what a real camera takes to deliver.
        """
        limit = self._state.time_s - age_s
        for capture in reversed(self._simulation.frames.copy()):
            if capture.time_s <= limit:
                return capture, capture.time_s + self._offset_s
        return None

    def _run(self) -> None:
        try:
            while not self._stop.wait(_PERIOD_S):
                self._catch_up()
        except Exception as error:  # noqa: BLE001 - `state` raises it where somebody hears it
            self._failure = error

    def _catch_up(self) -> None:
        simulation = self._simulation
        target_s = self._clock.now() - self._offset_s
        lag_s = target_s - simulation.now_s
        if lag_s > _MAX_LAG_S:
            self._offset_s += lag_s
            self._lost_s += lag_s
            return
        while self._inbox:
            simulation.enqueue(self._inbox.popleft())
        # Steps are whole: round down, so that simulated time never runs ahead.
        simulation.run_until(target_s - target_s % CONTROL_STEP_S)
        self._state = self._look()

    def _look(self) -> WorldState:
        simulation, start = self._simulation, self.start_pose
        told, motion = simulation.state(), simulation.motion
        if told.flying is FlyingState.LANDED:
            # The drone's own zero: wherever it stands before it takes off.
            self._base = _Base(z_m=motion.z_m, altitude_m=told.altitude_m)
        taking_off = told.flying is FlyingState.TAKING_OFF
        grounded = told.flying is FlyingState.LANDED or (
            taking_off and motion.z_m - self._base.z_m < _LIFTED_M
        )
        return WorldState(
            time_s=told.captured_s,
            flying=told.flying,
            lifting=not grounded,
            attitude=told.attitude,
            velocity=told.velocity,
            north_m=motion.x_m - start.x_m,
            east_m=start.y_m - motion.y_m,
            altitude_m=told.altitude_m - self._base.altitude_m,
            height_m=told.height_m,
            gimbal_pitch_rad=told.gimbal_pitch_rad,
            movement=told.movement,
        )
