"""The camera's height above the ground, smooth enough to compare two frames by."""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from uav_bt.types import DroneState, Frame


class SmoothHeight:
    """Blends the altimeter, right in the long run, with the vertical velocity, smooth in the short.

    Seen from two heights that differ by the altimeter's noise, ground that stands still seems to
    slide.

    Args:
        blend_s: over which the altimeter takes over.
        memory_s: how long the velocity is kept for late frames.
    """

    def __init__(self, blend_s: float = 1.0, memory_s: float = 3.0) -> None:
        self._blend_s = blend_s
        self._memory_s = memory_s
        self._sunk_m: deque[tuple[float, float]] = deque()  # by the velocity, at each time
        self._velocity_mps = 0.0
        self._level_m = math.nan  # the height of a drone that has not sunk
        self._seen_s = -math.inf

    def predict(self, state: DroneState) -> None:
        """Take in a telemetry sample; one that is not newer, or not finite, changes nothing."""
        time_s, down_mps = state.captured_s, state.velocity.down_mps
        if not (math.isfinite(time_s) and math.isfinite(down_mps)):
            return
        last_s, sunk_m = self._sunk_m[-1] if self._sunk_m else (time_s, 0.0)
        if self._sunk_m and time_s <= last_s:
            return
        sunk_m += 0.5 * (self._velocity_mps + down_mps) * (time_s - last_s)
        self._velocity_mps = down_mps
        self._sunk_m.append((time_s, sunk_m))
        while self._sunk_m[0][0] < time_s - self._memory_s:
            self._sunk_m.popleft()

    def see(self, frame: Frame) -> float:
        """Return the height above the ground at a frame's capture, metres; frames come in order."""
        times_s, sunk = zip(*self._sunk_m, strict=True) if self._sunk_m else ((0.0,), (0.0,))
        sunk_m = float(np.interp(frame.captured_s, times_s, sunk))
        level_m = frame.height_above_carpet_m + sunk_m
        if math.isnan(self._level_m):
            self._level_m = level_m
        passed_s = max(0.0, frame.captured_s - self._seen_s)
        self._level_m += (1.0 - math.exp(-passed_s / self._blend_s)) * (level_m - self._level_m)
        self._seen_s = frame.captured_s
        return self._level_m - sunk_m
