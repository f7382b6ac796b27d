"""Thread that draws the twin's images while the mission computes.

An OpenGL context belongs to one thread, so the renderer is made, used and freed in this one. The GL
calls release the interpreter lock.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from sim_bridge.twin.builder import LabModel
from sim_bridge.twin.render import Renderer
from sim_bridge.twin.simulation import Capture

Result = TypeVar("Result")


class RenderThread:
    """Draws images of one lab in a thread; close it when done.

    Args:
        lab: the compiled scene.

    Raises:
        MissingDependencyError: OpenGL does not work here; the message names the remedy.
        InputError: this process was forked from one that has drawn.
    """

    def __init__(self, lab: LabModel) -> None:
        self._thread = ThreadPoolExecutor(max_workers=1, thread_name_prefix="render")
        try:
            self._renderer = self._thread.submit(Renderer, lab).result()
        except BaseException:
            self._thread.shutdown()
            raise
        self._closed = False

    def start(self, draw: Callable[[Renderer], Result]) -> Future[Result]:
        """Call a function with the renderer in the thread, after everything started before."""
        return self._thread.submit(draw, self._renderer)

    def class_ids(self, capture: Capture, size_px: tuple[int, int]) -> NDArray[np.uint8]:
        """Return the exact class ids of a capture, (H, W) uint8, at a width and height."""
        view = capture.camera, *size_px, capture.movers
        return self.start(lambda renderer: renderer.class_ids(*view)).result()

    def depth(self, capture: Capture, size_px: tuple[int, int]) -> NDArray[np.float32]:
        """Return the exact depth along the optical axis, (H, W) float32, metres."""
        view = capture.camera, *size_px, capture.movers
        return self.start(lambda renderer: renderer.ids_and_depth(*view)).result()[1]

    def close(self) -> None:
        """Free the renderer and end the thread, after everything started; safe to call twice."""
        if not self._closed:
            self._closed = True
            self.start(Renderer.close).result()
            self._thread.shutdown()
