"""`PlainDrone`: the twin's drone without images."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from sim_bridge.plain.caster import Caster
from sim_bridge.plain.sight import PlainSight
from sim_bridge.twin.noise import child_seed
from sim_bridge.twin.profile import Profile
from sim_bridge.twin.scene import Scene
from sim_bridge.twin.simulated_drone import SimulatedDrone
from sim_bridge.twin.simulation import Capture, Simulation

_SIZE_PX: Final = (112, 63)  # of the frames, 16:9 as the video
# The frames show noise, grey levels: they differ from each other as a camera's do, so that a frozen
# or black video is noticed.
_GREYS: Final = (110, 140)
_SHIFTS: Final = 4096  # places in the noise at which a frame may begin


class PlainDrone(SimulatedDrone):
    """A simulated ANAFI whose frames show nothing; implements `Drone` and `Imageless`."""

    drawn = False

    def __init__(
        self, scene: Scene, *, profile: Profile, seed: int = 0, realtime: bool = False
    ) -> None:
        super().__init__(
            scene, profile=profile, seed=seed, image_size_px=_SIZE_PX, realtime=realtime
        )
        self.sight: PlainSight | None = None  # the perception; None before connecting

    def _open_eyes(self, simulation: Simulation) -> _PlainEyes:
        self.sight = PlainSight(self.scene, simulation, self._seed)
        return _PlainEyes(self.scene, self._seed)

    def disconnect(self) -> None:
        """End the flight; safe to call twice."""
        super().disconnect()
        self.sight = None


class _PlainEyes:
    """Frames of noise, and exact views by ray casting; implements `Eyes`."""

    def __init__(self, scene: Scene, seed: int) -> None:
        self._scene = scene
        self._casters: dict[tuple[int, int], Caster] = {}
        values = _SIZE_PX[0] * _SIZE_PX[1] * 3 + _SHIFTS
        generator = np.random.default_rng(child_seed(seed, 15))
        self._noise = generator.integers(*_GREYS, values, dtype=np.uint8)

    def image(self, capture: Capture) -> NDArray[np.uint8]:
        width_px, height_px = _SIZE_PX
        start = 7 * capture.index % _SHIFTS
        noise = self._noise[start : start + width_px * height_px * 3]
        return noise.reshape(height_px, width_px, 3).copy()

    def expect(self, capture: Capture) -> None:
        pass  # an image takes no time

    def exact(
        self, capture: Capture, width_px: int, height_px: int
    ) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
        size_px = width_px, height_px
        if size_px not in self._casters:
            self._casters[size_px] = Caster(self._scene, size_px)
        return self._casters[size_px].cast(capture.camera, capture.movers)

    def close(self) -> None:
        pass
