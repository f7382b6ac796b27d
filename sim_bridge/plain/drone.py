"""`PlainDrone`: the twin's drone without images."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sim_bridge.plain.caster import Caster
from sim_bridge.plain.sight import PlainSight
from sim_bridge.twin.noise import child_seed
from sim_bridge.twin.scene import Scene
from sim_bridge.twin.simulated_drone import ExactView, SimulatedDrone
from sim_bridge.twin.simulation import Capture, Simulation
from uav_bt.types import CameraModel

SIZE_PX: Final = (112, 63)  # of the frames, 16:9 as the video
# The frames show noise, grey levels: they differ from each other as a camera's do, so that a frozen
# or black video is noticed.
_GREYS: Final = (110, 140)
_SHIFTS: Final = 4096  # places in the noise at which a frame may begin


class PlainDrone(SimulatedDrone):
    """A simulated ANAFI whose frames show nothing; implements `Drone` and `Imageless`."""

    drawn = False
    sight: PlainSight | None = None  # the perception; None before connecting

    def _open_eyes(self, simulation: Simulation) -> _PlainEyes:
        self.sight = PlainSight(self.scene, simulation, self._seed)
        return _PlainEyes(self.scene, self.camera, self._seed)

    def disconnect(self) -> None:
        """End the flight; safe to call twice."""
        super().disconnect()
        self.sight = None


class _PlainEyes:
    """Frames of noise, and exact views by ray casting; implements `Eyes`."""

    def __init__(self, scene: Scene, camera: CameraModel, seed: int) -> None:
        self._scene = scene
        self._casters: dict[tuple[int, int], Caster] = {}
        self._shape = camera.height_px, camera.width_px, 3
        generator = np.random.default_rng(child_seed(seed, 15))
        values = math.prod(self._shape) + _SHIFTS
        self._noise = generator.integers(*_GREYS, values, dtype=np.uint8)

    def image(self, capture: Capture) -> NDArray[np.uint8]:
        start = 7 * capture.index % _SHIFTS
        return self._noise[start : start + math.prod(self._shape)].reshape(self._shape).copy()

    def expect(self, capture: Capture) -> None:
        pass  # an image takes no time

    def exact(self, capture: Capture, width_px: int, height_px: int) -> ExactView:
        size_px = width_px, height_px
        if size_px not in self._casters:
            self._casters[size_px] = Caster(self._scene, size_px)
        return self._casters[size_px].cast(capture.camera, capture.movers)

    def close(self) -> None:
        pass
