"""`TwinDrone`: the simulated ANAFI behind the `Drone` protocol."""

from __future__ import annotations

from concurrent.futures import Future, ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from sim_bridge.twin.builder import LabModel
from sim_bridge.twin.camera import Optics
from sim_bridge.twin.render import Renderer
from sim_bridge.twin.simulated_drone import ExactView, SimulatedDrone
from sim_bridge.twin.simulation import Capture, Simulation


class TwinDrone(SimulatedDrone):
    """A simulated ANAFI in the simulated lab, with a camera; implements the `Drone` protocol."""

    drawn = True

    def _open_eyes(self, simulation: Simulation) -> _DrawnEyes:
        size_px = self.camera.width_px, self.camera.height_px
        optics = Optics(self.profile, *size_px, self._seed)
        return _DrawnEyes(simulation.body.lab, size_px, optics)


class _DrawnEyes:
    """Draws images in a thread while the mission computes; implements `Eyes`.

    An OpenGL context belongs to one thread, so the renderer is made, used and freed in this one.
    The GL calls release the interpreter lock.
    """

    def __init__(self, lab: LabModel, size_px: tuple[int, int], optics: Optics) -> None:
        self._size_px, self._optics = size_px, optics
        self._thread = ThreadPoolExecutor(max_workers=1, thread_name_prefix="render")
        try:
            self._renderer = self._thread.submit(Renderer, lab).result()
        except BaseException:
            self._thread.shutdown()
            raise
        self._next: tuple[Capture, Future[NDArray[np.uint8]]] | None = None

    def image(self, capture: Capture) -> NDArray[np.uint8]:
        return self._started(capture).result()

    def expect(self, capture: Capture) -> None:
        self._started(capture)

    def _started(self, capture: Capture) -> Future[NDArray[np.uint8]]:
        if self._next is None or self._next[0] is not capture:
            self._next = capture, self._thread.submit(self._draw, capture)
        return self._next[1]

    def _draw(self, capture: Capture) -> NDArray[np.uint8]:
        clean = self._renderer.rgb(capture.camera, *self._size_px, capture.movers)
        return self._optics.degrade(clean, capture.index, capture.exposure)

    def exact(self, capture: Capture, width_px: int, height_px: int) -> ExactView:
        view = capture.camera, width_px, height_px, capture.movers
        return self._thread.submit(self._renderer.ids_and_depth, *view).result()

    def close(self) -> None:
        """Free the renderer and end the thread, after everything that was started."""
        self._thread.submit(self._renderer.close).result()
        self._thread.shutdown()
