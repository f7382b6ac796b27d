"""A photograph of the drone's own camera, asked for by a leaf and awaited without blocking."""

from __future__ import annotations

from uav_bt.protocols import Still, StillCamera, StillState


class CameraPhoto:
    """One photograph of the drone's camera.

    Args:
        camera: The drone's camera.
        now_s: Time at which it is asked for, s.
        limit_s: Longest wait for the camera, s.
    """

    def __init__(self, camera: StillCamera, now_s: float, limit_s: float) -> None:
        self._camera = camera
        self._asked_s = now_s
        self._limit_s = limit_s
        self._number = camera.take_still()

    def result(self, now_s: float) -> Still | None:
        """Return how it ended. None: the camera is still at work.

        Args:
            now_s: Present time on the clock of the start, s.
        """
        still = self._camera.still(self._number)
        if still.state is not StillState.TAKING:
            return still
        # Ticks are a tenth of a second, and floats add up.
        if now_s - self._asked_s >= self._limit_s - 1e-6:
            reason = f"the camera has not confirmed it within {self._limit_s:g} s"
            return Still(state=StillState.FAILED, reason=reason)
        return None
