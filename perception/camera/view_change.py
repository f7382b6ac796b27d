"""Recognition of an image that shows another place than the image before.

Quantities that are smoothed over time, such as the scale of a network's depth, belong to one place.
In flight the view moves on from frame to frame; at a cut of a video it does not.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial
from typing import Final

import cv2
import numpy as np

from uav_bt.errors import ValueRangeError
from uav_bt.types import Frame
from uav_bt.types.arrays import Image


@dataclass(frozen=True, kw_only=True)
class ViewChangeConfig:
    """When two images show different places.

    Attributes:
        alike: Correlation of the thumbnails, shifted by up to a quarter of the view, from which the
            images show one place. Points are tracked only below it.
        tracked: Share of the corners that must be found again where the correlation is lower.
        corners: Number of corners that are tracked at most.
        returned_px: Largest distance between a corner and itself, tracked there and back, in pixels
            of the small image.
        turned_rad: A turn of body or gimbal by more than this explains any change of the view.
        apart_s: In flight, frames that are further apart show one place: a drone that flew on
            without video has not left it.
        contrast: Least standard deviation of the thumbnail, grey levels. A bare wall has less, and
            shows no place.
    """

    # Between neighbouring frames of flights the correlation is below 0.6 in 2 % of the frames, and
    # the share then 0.3 and more unless the image is blank; between two flights it is below 0.6
    # in 94 %, with a share of 0 in nearly all.
    alike: float = 0.6
    tracked: float = 0.15
    corners: int = 80
    returned_px: float = 1.0
    turned_rad: float = math.radians(15)
    apart_s: float = 0.35
    contrast: float = 8.0

    def __post_init__(self) -> None:
        if not (0.0 <= self.alike <= 1.0 and 0.0 <= self.tracked <= 1.0 and self.corners >= 1):
            raise ValueRangeError(f"shares lie within 0 and 1, and corners are needed, got {self}")


_SMALL_PX: Final = (160, 90)  # width and height in which corners are tracked
_THUMBNAIL_PX: Final = (40, 24)
_CENTRE: Final = (slice(6, 18), slice(10, 30))  # of the thumbnail: half of both sides
_WINDOW_PX: Final = (13, 13)  # of the optical flow


class ViewChange:
    """Compares each frame with the one before.

    Args:
        config: when two images show different places.
    """

    def __init__(self, config: ViewChangeConfig | None = None) -> None:
        self._config = config or ViewChangeConfig()
        self._last: Image | None = None
        self._frame: Frame | None = None

    def __call__(self, frame: Frame, *, flown: bool = False) -> bool:
        """Return whether a frame shows another place than the frame before.

        Blank frames are passed over, so that a dark frame separates no two others.

        Args:
            frame: the next frame.
            flown: whether telemetry shows that the frames are of one flight.
        """
        grey = _small(frame.image)
        thumbnail = _thumbnail(grey)
        if cv2.meanStdDev(thumbnail)[1].item() < self._config.contrast:
            return False
        last, before = self._last, self._frame
        self._last, self._frame = grey, frame
        if last is None or before is None:
            return False
        if flown and frame.captured_s - before.captured_s > self._config.apart_s:
            return False
        if correlation(_thumbnail(last), thumbnail) >= self._config.alike:
            return False
        if _turned_rad(before, frame) > self._config.turned_rad:
            return False
        return tracked_share(last, grey, self._config) < self._config.tracked


def _small(rgb: Image) -> Image:
    """Return the green of an image, small; all pixels and all colours would take long."""
    step = max(1, rgb.shape[1] // (2 * _SMALL_PX[0]))
    green = np.ascontiguousarray(rgb[::step, ::step, 1])
    return np.asarray(cv2.resize(green, _SMALL_PX, interpolation=cv2.INTER_AREA), np.uint8)


def _thumbnail(grey: Image) -> Image:
    return np.asarray(cv2.resize(grey, _THUMBNAIL_PX, interpolation=cv2.INTER_AREA), np.uint8)


def correlation(one: Image, other: Image) -> float:
    """Return the largest correlation of the middle of a thumbnail with a part of another one."""
    return float(cv2.matchTemplate(other, one[_CENTRE], cv2.TM_CCOEFF_NORMED).max())


def tracked_share(one: Image, other: Image, config: ViewChangeConfig) -> float:
    """Return the share of an image's corners that optical flow finds in another one.

    Args:
        one: (H, W) grey.
        other: (H, W) grey.
        config: number of corners, and the accuracy of those that count.

    Returns:
        0 to 1; 1 without corners, which say nothing.
    """
    corners = cv2.goodFeaturesToTrack(one, config.corners, 0.02, 4)
    if corners is None:
        return 1.0
    flow = partial(cv2.calcOpticalFlowPyrLK, winSize=_WINDOW_PX, maxLevel=3)
    there, found, _ = flow(one, other, corners, np.empty_like(corners))
    back, returned, _ = flow(other, one, there, np.empty_like(corners))
    off_px = np.linalg.norm(np.subtract(back, corners).reshape(-1, 2), axis=1)
    good = (found.ravel() == 1) & (returned.ravel() == 1) & (off_px < config.returned_px)
    return float(good.mean())


def _turned_rad(before: Frame, frame: Frame) -> float:
    yaw_rad = math.remainder(frame.attitude.yaw_rad - before.attitude.yaw_rad, math.tau)
    return max(abs(yaw_rad), abs(frame.gimbal_pitch_rad - before.gimbal_pitch_rad))
