"""Detection of blank and frozen frames that arrive in time."""

from __future__ import annotations

import math
from typing import Final

import cv2
import numpy as np

from uav_bt.types import DroneState, Frame
from uav_bt.types.arrays import Image

# Grey levels are 0 to 255.
# A twentieth of the image must reach this level. An image of a dark ground in the evening passes,
# because its other side shows a wall.
_DARK: Final = 20.0
_BRIGHT_SHARE: Final = 0.05
_BRIGHT: Final = 240.0  # mean level above which an image is overexposed
_CONTRAST: Final = 1.0  # least deviation of the shrunk image; a covered lens gives less
_SMALL_PX: Final = (64, 36)  # width and height of the shrunk image
_NOISE: Final = 30.0  # largest (J. Immerkaer, Fast Noise Variance Estimation, 1996)
# Immerkaer's kernel does not respond to edges and slopes. The median instead of the mean also
# suppresses texture.
_KERNEL: Final = np.array([[1, -2, 1], [-2, 4, -2], [1, -2, 1]], dtype=np.float32)
_MEDIAN_OF_NOISE: Final = 6.0 * 0.6745  # of its absolute response to noise with a deviation of 1
# After this number of frames in a row that differed from each other, an equal frame is a frozen
# video: the camera's noise shows. The first equal frame counts, because a frozen image in flight
# contradicts the telemetry of its time.
_NOISY: Final = 6
# The image must change during a turn of body or gimbal by this angle, and over this path.
_TURNED_RAD: Final = math.radians(4)
_MOVED_M: Final = 0.12


class FrameWatch:
    """Checks a sequence of frames.

    Equal frames for longer than `still_s` are a frozen video in any case: a real camera's noise
    differs from image to image, a simulated camera may have none.
    """

    def __init__(self, *, still_s: float = math.inf) -> None:
        self._still_s = still_s
        self._last: Image | None = None
        self._first: Frame | None = None  # the first of the equal frames
        self._seen_s = 0.0  # capture time of the newest frame
        self._moved_m = 0.0  # path length since the first of the equal frames
        self._noisy = 0  # consecutive frames that differed from the previous one

    def __call__(self, frame: Frame, state: DroneState) -> str | None:
        """Return why the newest frame is unusable; None when it is usable."""
        grey = np.asarray(cv2.cvtColor(frame.image, cv2.COLOR_RGB2GRAY), dtype=np.uint8)
        frozen = self._frozen(frame, grey, state)
        return _blank(grey) or ("the video is frozen" if frozen else None)

    def _frozen(self, frame: Frame, grey: Image, state: DroneState) -> bool:
        """Return whether the image stays equal although it should change."""
        same, first = self._last is not None and np.array_equal(self._last, grey), self._first
        if not same or first is None:
            self._noisy = 0 if same else self._noisy + 1
            self._last, self._first, self._seen_s = grey, frame, frame.captured_s
            self._moved_m = 0.0
            return False
        speed_mps = math.hypot(state.velocity.forward_mps, state.velocity.right_mps)
        self._moved_m += speed_mps * max(0.0, frame.captured_s - self._seen_s)
        self._seen_s = frame.captured_s
        turned_rad = math.remainder(frame.attitude.yaw_rad - first.attitude.yaw_rad, math.tau)
        tilted_rad = frame.gimbal_pitch_rad - first.gimbal_pitch_rad
        return (
            self._noisy > _NOISY
            or frame.captured_s - first.captured_s > self._still_s
            or max(abs(turned_rad), abs(tilted_rad)) > _TURNED_RAD
            or self._moved_m > _MOVED_M
        )


def _blank(grey: Image) -> str | None:
    """Return a message when an image shows nothing."""
    small = cv2.resize(grey, _SMALL_PX, interpolation=cv2.INTER_AREA)
    mean, contrast = (value.item() for value in cv2.meanStdDev(small))
    if np.count_nonzero(small >= _DARK) < _BRIGHT_SHARE * small.size:
        return "the image is dark"
    if mean > _BRIGHT:
        return "the image is overexposed"
    if contrast < _CONTRAST:
        return "the image shows nothing: is the lens covered?"
    detail = np.abs(cv2.filter2D(np.ascontiguousarray(grey[::2, ::2]), cv2.CV_16S, _KERNEL))
    # Its median is above the limit if most of it is, which is faster to count.
    if np.count_nonzero(detail > _NOISE * _MEDIAN_OF_NOISE) > detail.size / 2:
        noise = float(np.median(detail)) / _MEDIAN_OF_NOISE
        return f"the image is all noise ({noise:.0f} grey levels)"
    return None
