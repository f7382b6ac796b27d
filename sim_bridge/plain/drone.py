"""`PlainDrone`: the twin's drone without images."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from sim_bridge.plain.sight import PlainSight
from sim_bridge.twin.gl import load_physics
from sim_bridge.twin.noise import child_seed
from sim_bridge.twin.profile import Profile
from sim_bridge.twin.referee import TwinReferee
from sim_bridge.twin.scene import Scene
from sim_bridge.twin.simulated_drone import Running, SimulatedDrone
from sim_bridge.twin.simulation import Capture, Simulation
from sim_bridge.twin.variation import start_pose
from uav_bt.types import Frame, Observation

load_physics()  # before the modules below, which import MuJoCo

from sim_bridge.twin.flying_body import FlyingBody  # noqa: E402  (after load_physics)
from sim_bridge.twin.model import build_model  # noqa: E402  (after load_physics)

_SIZE_PX: Final = (112, 63)  # of the frames, 16:9 as the video
# The frames show noise, grey levels: they differ from each other as a camera's do, so that a frozen
# or black video is noticed.
_GREYS: Final = (110, 140)
_SHIFTS: Final = 4096  # places in the noise at which a frame may begin


@dataclass(frozen=True, kw_only=True)
class _Flight(Running):
    """Objects that exist while connected."""

    sight: PlainSight


class PlainDrone(SimulatedDrone):
    """A simulated ANAFI whose frames show nothing; implements `Drone` and `Imageless`.

    Args:
        scene: the lab.
        profile: limits and imperfections.
        seed: random seed of the flight, 0 or more.
        realtime: run at wall-clock speed instead of as fast as possible.

    Raises:
        ValueRangeError: the seed is negative.
    """

    def __init__(
        self, scene: Scene, *, profile: Profile, seed: int = 0, realtime: bool = False
    ) -> None:
        super().__init__(
            scene, profile=profile, seed=seed, image_size_px=_SIZE_PX, realtime=realtime
        )
        values = _SIZE_PX[0] * _SIZE_PX[1] * 3 + _SHIFTS
        generator = np.random.default_rng(child_seed(seed, 15))
        self._noise = generator.integers(*_GREYS, values, dtype=np.uint8)
        self._flight: _Flight | None = None
        self._last: Frame | None = None  # the newest delivered

    @property
    def sight(self) -> PlainSight | None:
        """The perception; None before connecting."""
        return self._flight.sight if self._flight is not None else None

    def connect(self) -> None:
        """Build the lab, and put the drone at its take-off point."""
        if self._flight is not None:
            return
        lab = build_model(self.scene, drawn=False)
        body = FlyingBody(lab, lag_s=self.profile.thrust_lag_s)
        start = start_pose(self.scene, self._seed)
        simulation = Simulation(self.scene, body, self.profile, self._seed, start)
        sight = PlainSight(self.scene, simulation, self._seed)
        self._last = None
        self._flight = _Flight(
            simulation=simulation,
            sight=sight,
            referee=TwinReferee(self.scene, simulation, sight.exact),
        )

    def observe(self) -> Observation:
        """Return the newest delivered frame and the state.

        Raises:
            DroneError: not connected.
        """
        newest = self.delivered(self.simulation.now_s)
        if newest is not None and (self._last is None or newest.index != self._last.index):
            self._last = self._frame(newest)
        return Observation(frame=self._last, state=self.simulation.state())

    def _frame(self, capture: Capture) -> Frame:
        telemetry, width_px, height_px = capture.telemetry, *_SIZE_PX
        start = 7 * capture.index % _SHIFTS
        noise = self._noise[start : start + width_px * height_px * 3]
        return Frame(
            image=noise.reshape(height_px, width_px, 3).copy(),
            index=capture.index,
            captured_s=capture.time_s,
            gimbal_pitch_rad=capture.camera.pitch_rad,
            attitude=telemetry.attitude,
            altitude_m=telemetry.altitude_m,
            height_m=telemetry.height_m,
            height_above_ground_m=telemetry.height_above_ground_m,
        )

    def disconnect(self) -> None:
        """End the flight; safe to call twice."""
        self._flight = None
