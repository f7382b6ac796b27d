"""Base of the simulated drones: the clock, the orders, the delivery of frames, and the referee."""

from __future__ import annotations

import math
import time
from abc import ABC, abstractmethod
from dataclasses import replace
from typing import ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from sim_bridge.anafi import ANAFI_AIRFRAME, anafi_camera
from sim_bridge.twin.body import TIME_SLACK_S
from sim_bridge.twin.flying_body import FlyingBody
from sim_bridge.twin.model import build_model
from sim_bridge.twin.profile import Profile
from sim_bridge.twin.scene import Scene
from sim_bridge.twin.simulation import Capture, Simulation
from sim_bridge.twin.variation import start_pose
from uav_bt.errors import DroneError, ValueRangeError
from uav_bt.types import Command, Frame, Observation, Pose, Truth, Velocity, clamp, limit_length
from uav_bt.types.ground import Ground

ExactView = tuple[NDArray[np.uint8], NDArray[np.float32]]
"""Class ids, and depth along the optical axis in metres, of one view, each (height, width)."""


class Eyes(Protocol):
    """Images for the mission, and exact views for the referee."""

    def image(self, capture: Capture) -> NDArray[np.uint8]:
        """Return the image of a capture, (H, W, 3) RGB."""

    def expect(self, capture: Capture) -> None:
        """Start on the image of a capture that will probably be asked for next."""

    def exact(self, capture: Capture, width_px: int, height_px: int) -> ExactView:
        """Return what a perfect network would see of a capture."""

    def close(self) -> None:
        """Free the resources of the images."""


class SimulatedDrone(ABC):
    """A drone in the twin's physics; a subclass adds perception.

    Time passes only in `clock.sleep_until`, which advances the physics in steps of 10 ms.

    Raises:
        ValueRangeError: the seed is negative or the size is not 16:9.
    """

    airframe = ANAFI_AIRFRAME
    live = False  # a simulated drone needs no check before it takes off
    tick_s: float | None = None  # None: the mission sets the length of a tick
    drawn: ClassVar[bool]  # whether a camera looks at the lab

    def __init__(
        self,
        scene: Scene,
        *,
        profile: Profile,
        seed: int = 0,
        image_size_px: tuple[int, int] = (640, 360),
        realtime: bool = False,
    ) -> None:
        if seed < 0:
            raise ValueRangeError(f"the seed must be zero or a positive number, got {seed}")
        self.scene = scene
        self.profile = profile
        self.camera = anafi_camera(*image_size_px)
        self.clock = SimulatedClock(self, realtime=realtime)
        self._seed = seed
        self.referee: SimulatedReferee | None = None  # None before connecting
        self._flight: tuple[Simulation, Eyes] | None = None
        self._last: Frame | None = None  # the newest delivered
        self._observed_s = 0.0

    def connect(self) -> None:
        """Build the lab, and put the drone at its take-off point.

        Raises:
            MissingDependencyError: OpenGL does not work here; the message names the remedy.
        """
        if self._flight is not None:
            return
        lab, start = build_model(self.scene, drawn=self.drawn), start_pose(self.scene, self._seed)
        body = FlyingBody(lab, lag_s=self.profile.thrust_lag_s)
        simulation = Simulation(self.scene, body, self.profile, self._seed, start)
        eyes = self._open_eyes(simulation)
        self.referee = SimulatedReferee(self.scene, simulation, eyes)
        self._flight = simulation, eyes
        self._last, self._observed_s = None, 0.0

    @abstractmethod
    def _open_eyes(self, simulation: Simulation) -> Eyes:
        """Return what sees the lab of a flight."""

    def disconnect(self) -> None:
        """End the flight; safe to call twice."""
        if self._flight is not None:
            self._flight[1].close()
            self._flight = self.referee = None

    def _connected(self) -> tuple[Simulation, Eyes]:
        if self._flight is None:
            raise DroneError("the drone is not connected; call connect() first")
        return self._flight

    @property
    def simulation(self) -> Simulation:
        """The running simulation; DroneError if not connected."""
        return self._connected()[0]

    def disturb(
        self,
        *,
        wind_mps2: tuple[float, float] = (0.0, 0.0),
        drift_mps: tuple[float, float] = (0.0, 0.0),
    ) -> None:
        """Apply a steady wind, and a drift that the drone does not measure, in world axes."""
        self.simulation.disturb(wind_mps2=wind_mps2, drift_mps=drift_mps)

    def send(self, command: Command) -> Command:
        """Send a command and return it as sent, with speeds limited to those of the profile."""
        order, profile = command.movement, self.profile
        if isinstance(order, Velocity):
            forward_mps, right_mps = limit_length(
                order.forward_mps, order.right_mps, profile.max_speed_mps
            )
            limited = Velocity(
                forward_mps=forward_mps,
                right_mps=right_mps,
                down_mps=clamp(order.down_mps, profile.max_climb_mps),
                yaw_rate_radps=clamp(order.yaw_rate_radps, profile.max_yaw_rate_radps),
            )
            command = replace(command, movement=limited)
        self.simulation.enqueue(command)
        return command

    def observe(self) -> Observation:
        """Return the newest delivered frame and the state.

        The frame of the next observation has often been captured already, because video arrives
        late. Its drawing is started.
        """
        simulation, eyes = self._connected()
        now_s = simulation.now_s
        period_s, self._observed_s = now_s - self._observed_s, now_s
        newest, following = self._delivered(now_s), self._delivered(now_s + period_s)
        if newest is not None and (self._last is None or newest.index != self._last.index):
            measured = newest.telemetry
            self._last = Frame(
                image=eyes.image(newest),
                index=newest.index,
                captured_s=newest.time_s,
                gimbal_pitch_rad=newest.camera.pitch_rad,
                attitude=measured.attitude,
                altitude_m=measured.altitude_m,
                height_m=measured.height_m,
                height_above_ground_m=measured.height_above_ground_m,
            )
        if following is not None and following is not newest:
            eyes.expect(following)
        return Observation(frame=self._last, state=simulation.state())

    def _delivered(self, time_s: float) -> Capture | None:
        """Return the newest capture that has been delivered by a time; None before the first."""
        limit_s = time_s - self.profile.video_latency_s + TIME_SLACK_S
        frames = reversed(self.simulation.frames)
        return next((capture for capture in frames if capture.time_s <= limit_s), None)


class SimulatedClock:
    """Clock of the flight; it raises DroneError before the drone is connected."""

    def __init__(self, drone: SimulatedDrone, *, realtime: bool) -> None:
        self._drone = drone
        self._realtime = realtime
        self._wall_start_s: float | None = None

    def now(self) -> float:
        """Return the time since connecting, s."""
        return self._drone.simulation.now_s

    def sleep_until(self, time_s: float) -> None:
        """Advance the physics to a time, rounded up to 10 ms; a past time has no effect."""
        simulation = self._drone.simulation
        if self._realtime and self._wall_start_s is None:
            self._wall_start_s = time.monotonic() - simulation.now_s
        simulation.run_until(time_s)
        if self._wall_start_s is not None:
            elapsed_s = time.monotonic() - self._wall_start_s
            time.sleep(max(0.0, simulation.now_s - elapsed_s))  # noqa: TID251 - a clock, too


class SimulatedReferee:
    """Reports the true state of one flight."""

    def __init__(self, scene: Scene, simulation: Simulation, eyes: Eyes) -> None:
        self._scene = scene
        self._simulation = simulation
        self._eyes = eyes

    def truth(self) -> Truth:
        """Return the present truth; contacts include those of the last 0.1 s."""
        simulation, pads, motion = self._simulation, self._scene.pads, self._simulation.motion
        x, y = motion.x_m, motion.y_m
        return Truth(
            time_s=simulation.now_s,
            pose=Pose(x_m=x, y_m=y, z_m=motion.z_m, yaw_rad=motion.yaw_rad),
            contacts=simulation.contacts(),
            clearance_m=simulation.body.clearance_m(),
            inside_ground=self._scene.ground_plan.contains(x, y),
            on_mark=any(pad.footprint.contains(x, y) for pad in pads),
            landing_error_m=math.dist((x, y), pads[0].position_m) if pads else None,
            motors_on=simulation.motors_on,
            gimbal_pitch_rad=simulation.gimbal_pitch_rad,
            movers=simulation.movers,
        )

    def ground(self) -> Ground:
        """Return the ground and the objects on it."""
        return self._scene.ground_plan

    def class_ids(self, frame: Frame, width_px: int, height_px: int) -> NDArray[np.uint8]:
        """Return the exact class ids of a delivered frame's view, (height_px, width_px)."""
        return self._exact(frame, width_px, height_px)[0]

    def depth(self, frame: Frame, width_px: int, height_px: int) -> NDArray[np.float32]:
        """Return the exact depth of a delivered frame's view, metres along the optical axis."""
        return self._exact(frame, width_px, height_px)[1]

    def _exact(self, frame: Frame, width_px: int, height_px: int) -> ExactView:
        capture = self._simulation.capture_of(frame.index)
        if capture.time_s != frame.captured_s:
            raise ValueRangeError(
                f"frame {frame.index} of {frame.captured_s:.2f} s is not of this flight; ask only "
                "the referee of the drone that sent it"
            )
        return self._eyes.exact(capture, width_px, height_px)
