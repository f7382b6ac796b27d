"""Detection of blank and frozen frames that arrive in time."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from uav_bt.types import DroneState, Frame


@dataclass(frozen=True, kw_only=True)
class FrameWatchConfig:
    """Thresholds for unusable images.

    Attributes:
        dark: A twentieth of the image must reach this grey level, 0 to 255. An image of a dark
            ground in the evening passes, because its other side shows a wall.
        bright: The mean grey level above which an image is overexposed, 0 to 255.
        contrast: Minimum standard deviation of the shrunk image, grey levels. A covered lens gives
            less.
        noise: Maximum noise, grey levels (J. Immerkaer, Fast Noise Variance Estimation, 1996).
        noisy: After this number of frames in a row that differed from each other, an equal frame is
            a frozen video: the camera's noise shows. The first equal frame counts, because a
            frozen image in flight contradicts the telemetry of its time.
        still_s: Equal frames for longer than this are a frozen video in any case. A real camera's
            noise differs from image to image; a simulated camera may have no noise.
        turned_rad: The image must change during a turn of body or gimbal by this angle.
        moved_m: The image must change over a path of this length.
    """

    dark: float = 20.0
    bright: float = 240.0
    contrast: float = 1.0
    noise: float = 30.0
    noisy: int = 6
    still_s: float = math.inf
    turned_rad: float = math.radians(4)
    moved_m: float = 0.12


_SMALL = (64, 36)  # width and height of the shrunk image, px
_BRIGHT_SHARE = 0.05  # of an image that is not dark
# Immerkaer's kernel does not respond to edges and slopes. The median instead of the mean also
# suppresses texture.
_KERNEL = np.array([[1, -2, 1], [-2, 4, -2], [1, -2, 1]], dtype=np.float32)
_MEDIAN_OF_NOISE = 6.0 * 0.6745  # of its absolute response to noise with a deviation of 1


class FrameWatch:
    """Checks a sequence of frames.

    Args:
        config: thresholds for unusable images.
    """

    def __init__(self, config: FrameWatchConfig | None = None) -> None:
        self._config = config or FrameWatchConfig()
        self._last: NDArray[np.uint8] | None = None
        self._first: Frame | None = None  # the first of the equal frames
        self._seen_s = 0.0  # capture time of the newest frame
        self._moved_m = 0.0  # path length since the first of the equal frames
        self._noisy = 0  # consecutive frames that differed from the previous one

    def __call__(self, frame: Frame, state: DroneState) -> str | None:
        """Return why a frame is unusable; None when it is usable.

        Args:
            frame: the newest frame; newer than that of the previous call.
            state: the newest telemetry.
        """
        grey = np.asarray(cv2.cvtColor(frame.image, cv2.COLOR_RGB2GRAY), dtype=np.uint8)
        frozen = self._frozen(frame, grey, state)
        return self._blank(grey) or frozen

    def _blank(self, grey: NDArray[np.uint8]) -> str | None:
        config = self._config
        small = cv2.resize(grey, _SMALL, interpolation=cv2.INTER_AREA)
        mean, contrast = (value.item() for value in cv2.meanStdDev(small))
        if np.count_nonzero(small >= config.dark) < _BRIGHT_SHARE * small.size:
            return "the image is dark"
        if mean > config.bright:
            return "the image is overexposed"
        if contrast < config.contrast:
            return "the image shows nothing: is the lens covered?"
        detail = np.abs(cv2.filter2D(np.ascontiguousarray(grey[::2, ::2]), cv2.CV_16S, _KERNEL))
        # Its median is above the limit if most of it is, which is faster to count.
        if np.count_nonzero(detail > config.noise * _MEDIAN_OF_NOISE) > detail.size / 2:
            noise = float(np.median(detail)) / _MEDIAN_OF_NOISE
            return f"the image is all noise ({noise:.0f} grey levels)"
        return None

    def _frozen(self, frame: Frame, grey: NDArray[np.uint8], state: DroneState) -> str | None:
        """Return a message when the image stays equal although it should change."""
        same = self._last is not None and np.array_equal(self._last, grey)
        if not same or self._first is None:
            self._noisy = 0 if same else self._noisy + 1
            self._last, self._first, self._seen_s = grey, frame, frame.captured_s
            self._moved_m = 0.0
            return None
        speed_mps = math.hypot(state.velocity.forward_mps, state.velocity.right_mps)
        self._moved_m += speed_mps * max(0.0, frame.captured_s - self._seen_s)
        self._seen_s = frame.captured_s
        noisy = self._noisy > self._config.noisy
        still = frame.captured_s - self._first.captured_s > self._config.still_s
        return "the video is frozen" if noisy or still or self._should_differ(frame) else None

    def _should_differ(self, frame: Frame) -> bool:
        first = self._first or frame
        turned_rad = math.remainder(frame.attitude.yaw_rad - first.attitude.yaw_rad, math.tau)
        tilted_rad = frame.gimbal_pitch_rad - first.gimbal_pitch_rad
        turned = max(abs(turned_rad), abs(tilted_rad)) > self._config.turned_rad
        return turned or self._moved_m > self._config.moved_m
