"""The twin as a loopback ANAFI's world: its physics by the wall clock, on a thread of its own.

Without a scene the drone flies in an open field. Scripts written for the ANAFI move it by ten
metres and more, at some metres a second, and the lab's room is ten metres wide: so the field is the
lab without boxes, walls and ceiling, on a wide floor, and its drone is as fast as one outdoors.
"""

from __future__ import annotations

import math
import threading
from collections import deque
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from sim_bridge.loopback.world import WorldLimits, WorldState
from sim_bridge.twin.gl import load_mujoco
from sim_bridge.twin.profile import Profile
from sim_bridge.twin.reference import Pace
from sim_bridge.twin.scene import ROOM_SIZE_M, Helipad, Scene, TakeOffSpec
from sim_bridge.twin.variation import start_pose
from uav_bt.errors import DroneError
from uav_bt.protocols import Clock
from uav_bt.types import Command, FlyingState, GimbalTo, Hover, Movement, Pose

load_mujoco()  # before the modules below do: how it draws is settled at its import

import mujoco  # noqa: E402  (after load_mujoco)

from sim_bridge.twin.flying_body import CONTROL_STEP_S  # noqa: E402  (after load_mujoco)
from sim_bridge.twin.model import LabModel, build_model  # noqa: E402  (after load_mujoco)
from sim_bridge.twin.simulation import Capture, Simulation  # noqa: E402  (after load_mujoco)

_PERIOD_S: Final = 0.02  # s between two updates: two of the twin's control steps
_MAX_LAG_S: Final = 0.25  # s that physics may be late before the lost time is left out
_LIFTED_M: Final = 0.03  # m above where it stood: it flies
_BELOW_CEILING_M: Final = 0.8  # m that a drone keeps from the lab's ceiling

_FIELD: Final = Scene(
    name="field",
    helipad=Helipad(position_m=(0.0, 1.5)),
    take_off=TakeOffSpec(position_m=(0.0, 0.0)),
)
_FIELD_HALF_M: Final = 1000.0  # half the side of its floor
_HIDDEN_GROUP: Final = 5  # not drawn by default


@dataclass(frozen=True, kw_only=True, slots=True)
class _Zero:
    """The zero of altitudes: where the drone stood last."""

    z_m: float  # true
    altitude_m: float  # measured by the twin's sensors


class TwinWorld:
    """A `World` of MuJoCo in real time, which stands still until `start`.

    Args:
        scene: the lab; None is the open field.
        profile: limits and imperfections; in the field the limits are wider.
        seed: of everything random.
        clock: paces the physics.

    Raises:
        MissingDependencyError: MuJoCo or OpenGL does not work here.
    """

    def __init__(self, scene: Scene | None, *, profile: Profile, seed: int, clock: Clock) -> None:
        # Computing takes real time here, and the firmware sends telemetry at its own rate: the
        # simulation charges nothing for either.
        profile = replace(profile.with_instant_telemetry(), compute_latency_s=0.0)
        self.scene = _FIELD if scene is None else scene
        self.profile = _field_profile(profile) if scene is None else profile
        self.lab: LabModel = _build_field() if scene is None else build_model(scene)
        self.start_pose: Pose = start_pose(self.scene, seed)
        self._simulation = Simulation(self.scene, self.lab, self.profile, seed, self.start_pose)
        self.limits = WorldLimits(
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
        self._inbox: deque[tuple[Command, Pace | None]] = deque()
        self._movement: Movement = Hover()
        self._zero = _Zero(z_m=self.start_pose.z_m, altitude_m=0.0)
        self._offset_s = 0.0  # of the clock over the simulation's time
        self.lost_s = 0.0  # left out because the machine was too slow
        self._failure: Exception | None = None
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None
        self._state = self._measure()

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

    def move(self, movement: Movement, pace: Pace | None = None) -> None:
        """Order a movement.

        Args:
            movement: the movement.
            pace: of a `MoveBy`; None flies it as fast as the profile allows.
        """
        if movement != self._movement:
            self._movement = movement
            self._inbox.append((Command(movement=movement), pace))

    def point(self, pitch_rad: float) -> None:
        """Turn the camera."""
        # The movement under way comes along; repeated, it changes nothing.
        command = Command(movement=self._movement, gimbal=GimbalTo(pitch_rad=pitch_rad))
        self._inbox.append((command, None))

    def newest_capture(self, age_s: float) -> tuple[Capture, float] | None:
        """Return the newest camera frame that is old enough, and its capture time by the clock.

        Args:
            age_s: its minimum age, s: the latency of a real camera.
        """
        limit = self._state.time_s - age_s
        for capture in reversed(self._simulation.frames.copy()):
            if capture.time_s <= limit:
                return capture, capture.time_s + self._offset_s
        return None

    def catch_up(self) -> None:
        """Step the physics up to the clock's time; the thread that `start` begins does it."""
        simulation = self._simulation
        target_s = self._clock.now() - self._offset_s
        lag_s = target_s - simulation.now_s
        if lag_s > _MAX_LAG_S:
            self._offset_s += lag_s
            self.lost_s += lag_s
            return
        while self._inbox:
            simulation.enqueue(*self._inbox.popleft())
        # Steps are whole: round down, so that simulated time never runs ahead.
        simulation.run_until(target_s - target_s % CONTROL_STEP_S)
        self._state = self._measure()

    def _run(self) -> None:
        try:
            while not self._stop.wait(_PERIOD_S):
                self.catch_up()
        except Exception as error:  # noqa: BLE001 - `state` raises it on the caller's thread
            self._failure = error

    def _measure(self) -> WorldState:
        simulation, start = self._simulation, self.start_pose
        measured, motion = simulation.state(), simulation.motion
        if measured.flying is FlyingState.LANDED:
            # The drone's own zero: wherever it stands before it takes off.
            self._zero = _Zero(z_m=motion.z_m, altitude_m=measured.altitude_m)
        taking_off = measured.flying is FlyingState.TAKING_OFF
        grounded = measured.flying is FlyingState.LANDED or (
            taking_off and motion.z_m - self._zero.z_m < _LIFTED_M
        )
        return WorldState(
            time_s=measured.captured_s,
            flying=measured.flying,
            lifting=not grounded,
            attitude=measured.attitude,
            velocity=measured.velocity,
            north_m=motion.x_m - start.x_m,
            east_m=start.y_m - motion.y_m,
            altitude_m=measured.altitude_m - self._zero.altitude_m,
            height_m=measured.height_m,
            gimbal_pitch_rad=measured.gimbal_pitch_rad,
            movement=measured.movement,
        )


def _field_profile(profile: Profile) -> Profile:
    """Return a profile with the speeds of an ANAFI outdoors; delays and imperfections are kept.

    The speed is what the twin's autopilot still follows closely; the ANAFI itself reaches 15 m/s.
    """
    return replace(
        profile,
        max_speed_mps=4.0,
        max_climb_mps=3.0,
        max_acceleration_mps2=3.0,
        max_climb_acceleration_mps2=3.0,
        max_yaw_rate_radps=3.0,
        max_yaw_acceleration_radps2=6.0,
    )


def _build_field() -> LabModel:
    """Compile the field, in which the only obstacles are the ground and the pad."""
    lab = build_model(_FIELD)
    model = lab.model
    for index in range(model.ngeom):
        geom = model.geom(index)
        name = geom.name.removesuffix("/seen")
        if name == "ceiling" or name.startswith("wall-"):
            geom.contype = geom.conaffinity = 0
            geom.group = _HIDDEN_GROUP
        elif geom.name == "floor":
            geom.size[:2] = _FIELD_HALF_M
            model.geom_rbound[index] = 2.0 * _FIELD_HALF_M
            model.geom_aabb[index, 3:5] = _FIELD_HALF_M
    # The tree of bounding boxes was made for the small floor.
    model.opt.disableflags |= np.int32(mujoco.mjtDisableBit.mjDSBL_MIDPHASE.value)
    return lab
