"""The twin as the world of a loopback ANAFI: physics in real time, on a separate thread.

Without a scene the drone flies in an open field. Scripts for the ANAFI move it by 10 m and more at
several m/s, but the room of the lab is 10 m wide. So the field is the lab without boxes, walls and
ceiling, on a wide floor, and its drone has outdoor speeds.
"""

from __future__ import annotations

import math
import threading
from collections import deque
from dataclasses import replace
from typing import Final

import numpy as np

from sim_bridge.loopback.world import WorldState
from sim_bridge.twin.body import CONTROL_STEP_S
from sim_bridge.twin.builder import LabModel
from sim_bridge.twin.flying_body import FlyingBody
from sim_bridge.twin.gl import mujoco
from sim_bridge.twin.model import build_model
from sim_bridge.twin.objects import Helipad
from sim_bridge.twin.profile import Profile
from sim_bridge.twin.reference import Pace
from sim_bridge.twin.scene import Scene, TakeOffSpec
from sim_bridge.twin.simulation import Capture, Simulation
from sim_bridge.twin.variation import start_pose
from uav_bt.errors import DroneError
from uav_bt.protocols import Clock
from uav_bt.types import Command, FlyingState, GimbalTo, Hover, Movement, Pose, wrap_angle

_PERIOD_S: Final = 0.02  # s between two updates: two control steps of the twin
_MAX_LAG_S: Final = 0.25  # largest lag of the physics, s; beyond it the lost time is skipped
_LIFTED_M: Final = 0.03  # height above the ground position from which the drone flies
_BELOW_CEILING_M: Final = 0.8  # least distance from the lab's ceiling

_FIELD: Final = Scene(
    name="field",
    helipad=Helipad(position_m=(0.0, 1.5)),
    take_off=TakeOffSpec(position_m=(0.0, 0.0)),
)
_FIELD_HALF_M: Final = 1000.0  # half the side of the field's floor
_HIDDEN_GROUP: Final = 5  # not drawn by default


class TwinWorld:
    """The drone's body in a lab (None: in the open field), in real time from `start` on."""

    def __init__(self, scene: Scene | None, profile: Profile, seed: int, clock: Clock) -> None:
        # Computing takes real time here, and the firmware sets the rate of telemetry. The
        # simulation adds no delay for either.
        profile = replace(profile.with_instant_telemetry(), compute_latency_s=0.0)
        self.outdoors = scene is None  # in the open field, with a GPS fix
        self.scene = _FIELD if scene is None else scene
        self.profile = _field_profile(profile) if scene is None else profile
        self.lab: LabModel = _build_field() if scene is None else build_model(scene)
        self.start_pose: Pose = start_pose(self.scene, seed)
        body = FlyingBody(self.lab, lag_s=self.profile.thrust_lag_s)
        self._simulation = Simulation(self.scene, body, self.profile, seed, self.start_pose)
        self.pace = Pace(  # speed limits of the body
            speed_mps=self.profile.max_speed_mps,
            climb_mps=self.profile.max_climb_mps,
            yaw_rate_radps=self.profile.max_yaw_rate_radps,
        )
        self.ceiling_m = math.inf  # altitude limit above the take-off point
        if not self.outdoors:
            self.ceiling_m = self.scene.room_size_m[2] - self.start_pose.z_m - _BELOW_CEILING_M
        self._clock = clock
        self._inbox: deque[tuple[Command, Pace | None]] = deque()
        self._movement: Movement = Hover()
        self._ground_z_m = self.start_pose.z_m  # true height of the last position on the ground
        self._ground_altitude_m = 0.0  # altitude that the sensors measured there
        self._turned_rad = 0.0  # yaw without wrapping
        self._offset_s = 0.0  # time of the clock minus time of the simulation
        self.lost_s = 0.0  # time skipped because the machine was too slow
        self._failure: Exception | None = None
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="twin-world", daemon=True)
        self._state = self._measure()

    def start(self) -> None:
        """Start the time."""
        self._offset_s = self._clock.now() - self._simulation.now_s
        self._thread.start()

    def stop(self) -> None:
        """Stop the time for good; safe to call twice."""
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join()

    def state(self) -> WorldState:
        """Return the newest state; DroneError if the simulation failed."""
        if self._failure is not None:
            raise DroneError(f"the simulation failed: {self._failure}") from self._failure
        return self._state

    def move(self, movement: Movement, pace: Pace | None = None) -> None:
        """Command a movement, a `MoveBy` at a pace (None: at the greatest)."""
        if movement != self._movement:
            self._movement = movement
            self._inbox.append((Command(movement=movement), pace))

    def point(self, pitch_rad: float) -> None:
        """Turn the camera."""
        # The command repeats the present movement, which has no effect.
        command = Command(movement=self._movement, gimbal=GimbalTo(pitch_rad=pitch_rad))
        self._inbox.append((command, None))

    def newest_capture(self, age_s: float) -> tuple[Capture, float] | None:
        """Return the newest camera frame of a minimum age, and its capture time by the clock."""
        limit = self._state.captured_s - age_s
        for capture in reversed(self._simulation.frames.copy()):
            if capture.time_s <= limit:
                return capture, capture.time_s + self._offset_s
        return None

    def catch_up(self) -> None:
        """Advance the physics to the time of the clock; called by the thread of `start`."""
        simulation = self._simulation
        target_s = self._clock.now() - self._offset_s
        lag_s = target_s - simulation.now_s
        if lag_s > _MAX_LAG_S:
            self._offset_s += lag_s
            self.lost_s += lag_s
            return
        while self._inbox:
            simulation.enqueue(*self._inbox.popleft())
        # Round down to whole steps, so that the simulation is never ahead of the clock.
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
            # The altitude is zero at each position on the ground before take-off.
            self._ground_z_m, self._ground_altitude_m = motion.z_m, measured.altitude_m
        grounded = measured.flying is FlyingState.LANDED
        if measured.flying is FlyingState.TAKING_OFF:
            grounded = motion.z_m - self._ground_z_m < _LIFTED_M
        altitude_m = measured.altitude_m - self._ground_altitude_m
        self._turned_rad += wrap_angle(measured.attitude.yaw_rad - self._turned_rad)
        return WorldState(
            **(vars(measured) | {"measured": None, "altitude_m": altitude_m}),
            lifting=not grounded,
            north_m=motion.x_m - start.x_m,
            east_m=start.y_m - motion.y_m,
            turned_rad=self._turned_rad,
        )


def _field_profile(profile: Profile) -> Profile:
    """Return a profile with outdoor speeds of an ANAFI, but the same delays and imperfections.

    The speed is the largest that the twin's autopilot follows closely; the ANAFI reaches 15 m/s.
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
    """Compile the field, which contains only the ground and the pad."""
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
    # The tree of bounding boxes was computed for the small floor.
    model.opt.disableflags |= np.int32(mujoco.mjtDisableBit.mjDSBL_MIDPHASE.value)
    return lab
