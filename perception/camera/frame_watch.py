"""Blindness that looks like sight: frames that arrive in time and show nothing, or nothing new."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from uav_bt.types import DroneState, Frame


@dataclass(frozen=True, kw_only=True)
class FrameWatchConfig:
    """When an image cannot be flown by.

    Attributes:
        dark: grey level above which a twentieth of the image has to be, 0 to 255; black carpet in
            the evening is one side of an image whose other side shows a wall.
        bright: mean grey level above which nothing is seen.
        contrast: least standard deviation of the blurred image, grey levels; a lens that is covered
            shows less.
        noise: most noise, grey levels (J. Immerkaer, Fast Noise Variance Estimation, 1996).
        repeats: so many equal frames in a row are a frozen video where no two were equal before.
        still_s: so long the same image is a frozen video in any case; a real camera's noise differs
            from image to image, a simulated one may have none.
        turned_rad: a turn of body or gimbal in which the image must change.
        moved_m: a way in which the image must change.
    """

    dark: float = 20.0
    bright: float = 240.0
    contrast: float = 1.0
    noise: float = 30.0
    repeats: int = 6
    still_s: float = math.inf
    turned_rad: float = math.radians(4)
    moved_m: float = 0.12


_SMALL = (64, 36)  # width and height of the image that is judged, pixels
# Immerkaer's kernel: blind to edges and slopes. The median instead of the mean makes it deaf to
# texture, too.
_KERNEL = np.array([[1, -2, 1], [-2, 4, -2], [1, -2, 1]], dtype=np.float32)
_KERNEL_GAIN = 6.0
_MEDIAN_TO_SIGMA = 0.6745


class FrameWatch:
    """Judges one frame after the other.

    Args:
        config: when an image cannot be flown by.
    """

    def __init__(self, config: FrameWatchConfig | None = None) -> None:
        self._config = config or FrameWatchConfig()
        self._last: NDArray[np.uint8] | None = None
        self._first: Frame | None = None  # of the frames that show the same
        self._seen_s = 0.0  # capture time of the newest frame
        self._moved_m = 0.0  # since the first of them
        self._repeats = 0
        self._noisy = 0  # frames in a row that differed from the one before

    def __call__(self, frame: Frame, state: DroneState) -> str | None:
        """Return why a frame cannot be flown by, None when it can.

        Args:
            frame: newer than the one before.
            state: the newest telemetry.
        """
        grey = np.asarray(cv2.cvtColor(frame.image, cv2.COLOR_RGB2GRAY), dtype=np.uint8)
        frozen = self._frozen(frame, grey, state)
        return self._blank(grey) or frozen

    def _blank(self, grey: NDArray[np.uint8]) -> str | None:
        config = self._config
        small = cv2.resize(grey, _SMALL, interpolation=cv2.INTER_AREA)
        mean, contrast = float(small.mean()), float(small.std())
        if np.percentile(small, 95) < config.dark:
            return "the image is dark"
        if mean > config.bright:
            return "the image is overexposed"
        if contrast < config.contrast:
            return "the image shows nothing: is the lens covered?"
        detail = cv2.filter2D(grey[::2, ::2].astype(np.float32), -1, _KERNEL)
        noise = float(np.median(np.abs(detail))) / (_KERNEL_GAIN * _MEDIAN_TO_SIGMA)
        if noise > config.noise:
            return f"the image is all noise ({noise:.0f} grey levels)"
        return None

    def _frozen(self, frame: Frame, grey: NDArray[np.uint8], state: DroneState) -> str | None:
        """Return a complaint when the image stays the same and should not."""
        same = self._last is not None and np.array_equal(self._last, grey)
        if not same or self._first is None:
            self._noisy = 0 if same else self._noisy + 1
            self._last, self._first, self._seen_s = grey, frame, frame.captured_s
            self._moved_m, self._repeats = 0.0, 0
            return None
        self._repeats += 1
        speed_mps = math.hypot(state.velocity.forward_mps, state.velocity.right_mps)
        self._moved_m += speed_mps * max(0.0, frame.captured_s - self._seen_s)
        self._seen_s = frame.captured_s
        # A camera whose images always differed by their noise does not show the same one twice.
        repeats = self._config.repeats
        noisy = self._noisy > repeats and self._repeats >= repeats
        still = frame.captured_s - self._first.captured_s > self._config.still_s
        return "the video is frozen" if noisy or still or self._should_differ(frame) else None

    def _should_differ(self, frame: Frame) -> bool:
        first = self._first or frame
        turned_rad = math.remainder(frame.attitude.yaw_rad - first.attitude.yaw_rad, math.tau)
        tilted_rad = frame.gimbal_pitch_rad - first.gimbal_pitch_rad
        turned = max(abs(turned_rad), abs(tilted_rad)) > self._config.turned_rad
        return turned or self._moved_m > self._config.moved_m
