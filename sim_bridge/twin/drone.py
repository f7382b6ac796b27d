"""`TwinDrone`: the simulated ANAFI behind the `Drone` protocol."""

from __future__ import annotations

import time
from concurrent.futures import Future
from dataclasses import dataclass, replace
from functools import partial
from typing import Final

from sim_bridge.anafi import ANAFI_AIRFRAME, anafi_camera
from sim_bridge.twin.camera import Optics
from sim_bridge.twin.gl import load_mujoco
from sim_bridge.twin.profile import Profile
from sim_bridge.twin.scene import Scene
from sim_bridge.twin.variation import start_pose
from uav_bt.errors import DroneError, ValueRangeError
from uav_bt.types import Command, Frame, Observation, Velocity, clamp, limit_length

load_mujoco()  # before the modules below: MuJoCo selects its OpenGL backend when imported

from sim_bridge.twin.model import build_model  # noqa: E402  (after load_mujoco)
from sim_bridge.twin.referee import TwinReferee  # noqa: E402  (after load_mujoco)
from sim_bridge.twin.render import Renderer  # noqa: E402  (after load_mujoco)
from sim_bridge.twin.render_thread import RenderThread  # noqa: E402  (after load_mujoco)
from sim_bridge.twin.simulation import Capture, Simulation  # noqa: E402  (after load_mujoco)

_TIME_SLACK_S: Final = 1e-6  # rounding error of a sum of control steps, s


@dataclass(frozen=True, kw_only=True)
class _Flight:
    """Objects that exist while connected."""

    simulation: Simulation
    thread: RenderThread
    referee: TwinReferee
    optics: Optics


class TwinDrone:
    """A simulated ANAFI in the simulated lab; implements the `Drone` protocol.

    Time passes only in `clock.sleep_until`, which advances the physics in steps of 10 ms.

    Args:
        scene: the lab.
        profile: limits and imperfections.
        seed: random seed of the flight, 0 or more.
        image_size_px: width and height of the video, pixels, 16:9.
        realtime: run at wall-clock speed instead of as fast as possible.

    Raises:
        ValueRangeError: the seed is negative or the size is not 16:9.
    """

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
        self.airframe = ANAFI_AIRFRAME
        self.clock = TwinClock(self, realtime=realtime)
        self.live = False  # a simulated drone needs no check before it takes off
        self.tick_s = None  # None: the mission sets the length of a tick
        self._seed = seed
        self._flight: _Flight | None = None
        self._last: Frame | None = None  # the newest delivered
        self._next: tuple[Capture, Future[Frame]] | None = None  # for the observation to come
        self._observed_s = 0.0

    @property
    def referee(self) -> TwinReferee | None:
        """The referee; None before connecting."""
        return self._flight.referee if self._flight is not None else None

    @property
    def pilot_has_control(self) -> bool:
        """Whether a pilot flies; tests set it. Commands are then ignored."""
        return self.simulation.pilot_has_control

    @pilot_has_control.setter
    def pilot_has_control(self, value: bool) -> None:
        self.simulation.pilot_has_control = value

    @property
    def simulation(self) -> Simulation:
        """The running simulation.

        Raises:
            DroneError: not connected.
        """
        return self._connected().simulation

    def disturb(
        self,
        *,
        wind_mps2: tuple[float, float] = (0.0, 0.0),
        drift_mps: tuple[float, float] = (0.0, 0.0),
    ) -> None:
        """Apply a steady disturbance from now on, for tests; without arguments, remove it.

        Args:
            wind_mps2: acceleration by the wind, world x and y.
            drift_mps: velocity that the drone does not measure, world x and y.

        Raises:
            DroneError: not connected.
        """
        self.simulation.disturb(wind_mps2=wind_mps2, drift_mps=drift_mps)

    def connect(self) -> None:
        """Build the lab and the renderer, and put the drone at its take-off point.

        Raises:
            MissingDependencyError: OpenGL does not work here; the message says what to install.
        """
        if self._flight is not None:
            return
        lab = build_model(self.scene)
        thread = RenderThread(lab)
        start = start_pose(self.scene, self._seed)
        simulation = Simulation(self.scene, lab, self.profile, self._seed, start)
        size = self.camera.width_px, self.camera.height_px
        self._last, self._next, self._observed_s = None, None, 0.0
        self._flight = _Flight(
            simulation=simulation,
            thread=thread,
            referee=TwinReferee(self.scene, lab, simulation, thread),
            optics=Optics(self.profile, *size, self._seed),
        )

    def observe(self) -> Observation:
        """Return the newest delivered frame and the state.

        The frame of the next observation has often been captured already, because video arrives
        late. It is drawn in the meantime.

        Raises:
            DroneError: not connected.
        """
        flight = self._connected()
        now_s = flight.simulation.now_s
        period_s, self._observed_s = now_s - self._observed_s, now_s
        newest = self._delivered(now_s)
        if newest is not None and (self._last is None or newest.index != self._last.index):
            self._last = self._drawn(flight, newest).result()
        following = self._delivered(now_s + period_s)
        if following is not None and following is not newest:
            self._next = following, self._drawn(flight, following)
        return Observation(frame=self._last, state=flight.simulation.state())

    def _delivered(self, time_s: float) -> Capture | None:
        """Return the newest capture so far that has been delivered by a time."""
        limit_s = time_s - self.profile.video_latency_s + _TIME_SLACK_S
        frames = reversed(self.simulation.frames)
        return next((capture for capture in frames if capture.time_s <= limit_s), None)

    def _drawn(self, flight: _Flight, capture: Capture) -> Future[Frame]:
        """Return the frame of a capture; its drawing is started unless it is under way."""
        if self._next is not None and self._next[0] is capture:
            return self._next[1]
        return flight.thread.start(partial(self._draw, flight.optics, capture))

    def _draw(self, optics: Optics, capture: Capture, renderer: Renderer) -> Frame:
        camera, telemetry = self.camera, capture.telemetry
        clean = renderer.rgb(capture.camera, camera.width_px, camera.height_px, capture.movers)
        return Frame(
            image=optics.degrade(clean, capture.index, capture.exposure),
            index=capture.index,
            captured_s=capture.time_s,
            gimbal_pitch_rad=capture.camera.pitch_rad,
            attitude=telemetry.attitude,
            altitude_m=telemetry.altitude_m,
            height_m=telemetry.height_m,
            height_above_carpet_m=telemetry.height_above_carpet_m,
        )

    def send(self, command: Command) -> Command:
        """Send a command and return it as sent, with speeds limited to those of the profile.

        Raises:
            DroneError: not connected.
        """
        if isinstance(command.movement, Velocity):
            command = replace(command, movement=self._limited(command.movement))
        self.simulation.enqueue(command)
        return command

    def _limited(self, order: Velocity) -> Velocity:
        profile = self.profile
        forward_mps, right_mps = limit_length(
            order.forward_mps, order.right_mps, profile.max_speed_mps
        )
        return Velocity(
            forward_mps=forward_mps,
            right_mps=right_mps,
            down_mps=clamp(order.down_mps, profile.max_climb_mps),
            yaw_rate_radps=clamp(order.yaw_rate_radps, profile.max_yaw_rate_radps),
        )

    def disconnect(self) -> None:
        """Free the renderer; safe to call twice."""
        if self._flight is not None:
            self._flight.thread.close()
            self._flight = None

    def _connected(self) -> _Flight:
        if self._flight is None:
            raise DroneError("the twin is not connected; call connect() first")
        return self._flight


class TwinClock:
    """Clock of the flight. Time passes only in `sleep_until`."""

    def __init__(self, drone: TwinDrone, *, realtime: bool) -> None:
        self._drone = drone
        self._realtime = realtime
        self._wall_start_s: float | None = None

    def now(self) -> float:
        """Return the time since connecting, s; 0 before.

        Raises:
            DroneError: not connected.
        """
        return self._drone.simulation.now_s

    def sleep_until(self, time_s: float) -> None:
        """Advance the physics to a time, rounded up to 10 ms; a past time has no effect.

        Raises:
            DroneError: not connected.
        """
        simulation = self._drone.simulation
        if self._realtime and self._wall_start_s is None:
            self._wall_start_s = time.monotonic() - simulation.now_s
        simulation.run_until(time_s)
        if self._wall_start_s is not None:
            elapsed = time.monotonic() - self._wall_start_s
            time.sleep(max(0.0, simulation.now_s - elapsed))
