"""`TwinDrone`: the simulated ANAFI behind the `Drone` protocol."""

from __future__ import annotations

from concurrent.futures import Future
from dataclasses import dataclass
from functools import partial

from sim_bridge.twin.camera import Optics
from sim_bridge.twin.gl import load_mujoco
from sim_bridge.twin.profile import Profile
from sim_bridge.twin.scene import Scene
from sim_bridge.twin.variation import start_pose
from uav_bt.errors import DroneError
from uav_bt.types import Frame, Observation

load_mujoco()  # before the modules below: MuJoCo selects its OpenGL backend when imported

from sim_bridge.twin.flying_body import FlyingBody  # noqa: E402  (after load_mujoco)
from sim_bridge.twin.model import build_model  # noqa: E402  (after load_mujoco)
from sim_bridge.twin.referee import TwinReferee  # noqa: E402  (after load_mujoco)
from sim_bridge.twin.render import Renderer  # noqa: E402  (after load_mujoco)
from sim_bridge.twin.render_thread import RenderThread  # noqa: E402  (after load_mujoco)
from sim_bridge.twin.simulated_drone import Running, SimulatedDrone  # noqa: E402  (after load_mujoco)
from sim_bridge.twin.simulation import Capture, Simulation  # noqa: E402  (after load_mujoco)


@dataclass(frozen=True, kw_only=True)
class _Flight(Running):
    """Objects that exist while connected."""

    thread: RenderThread
    optics: Optics


class TwinDrone(SimulatedDrone):
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
        super().__init__(
            scene, profile=profile, seed=seed, image_size_px=image_size_px, realtime=realtime
        )
        self._flight: _Flight | None = None
        self._last: Frame | None = None  # the newest delivered
        self._next: tuple[Capture, Future[Frame]] | None = None  # for the observation to come
        self._observed_s = 0.0

    def connect(self) -> None:
        """Build the lab and the renderer, and put the drone at its take-off point.

        Raises:
            MissingDependencyError: OpenGL does not work here; the message names the remedy.
        """
        if self._flight is not None:
            return
        lab = build_model(self.scene)
        thread = RenderThread(lab)
        start = start_pose(self.scene, self._seed)
        body = FlyingBody(lab, lag_s=self.profile.thrust_lag_s)
        simulation = Simulation(self.scene, body, self.profile, self._seed, start)
        size = self.camera.width_px, self.camera.height_px
        self._last, self._next, self._observed_s = None, None, 0.0
        self._flight = _Flight(
            simulation=simulation,
            thread=thread,
            referee=TwinReferee(self.scene, simulation, thread),
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
        newest = self.delivered(now_s)
        if newest is not None and (self._last is None or newest.index != self._last.index):
            self._last = self._drawn(flight, newest).result()
        following = self.delivered(now_s + period_s)
        if following is not None and following is not newest:
            self._next = following, self._drawn(flight, following)
        return Observation(frame=self._last, state=flight.simulation.state())

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
            height_above_ground_m=telemetry.height_above_ground_m,
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
