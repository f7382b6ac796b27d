"""Camera of the twin: its pose, and the blur, exposure error and noise of its images."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from sim_bridge.twin.noise import child_seed
from sim_bridge.twin.profile import Profile
from uav_bt.types import Pose

_REFERENCE_WIDTH_PX = 640  # image width to which `Profile.blur_sigma_px` refers
_SLACK = 1 << 17  # range of the offset into the noise, array elements
_SCATTER = 2654435761  # Knuth's multiplicative hash: neighbouring frames get different noise


@dataclass(frozen=True, kw_only=True, slots=True)
class CameraPose(Pose):
    """Position and viewing direction of the lens; the gimbal keeps the horizon level."""

    pitch_rad: float  # 0 level, negative down

    def axes(self) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
        """Return the optical axis and the image's upward direction in the world."""
        cy, sy = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        cp, sp = math.cos(self.pitch_rad), math.sin(self.pitch_rad)
        return (cp * cy, cp * sy, sp), (-sp * cy, -sp * sy, cp)


class Optics:
    """Applies blur, exposure error and noise to images of one size, reproducibly.

    The noise is generated once. Each frame uses it from a different offset, which takes a tenth of
    the time of new noise.
    """

    def __init__(self, profile: Profile, width_px: int, height_px: int, seed: int) -> None:
        self._sigma = profile.blur_sigma_px * width_px / _REFERENCE_WIDTH_PX
        self._brighter: NDArray[np.uint8] | None = None
        if profile.image_noise_std > 0.0:
            generator = np.random.default_rng(child_seed(seed, 5))
            count = height_px * width_px * 3 + _SLACK
            noise = generator.standard_normal(count, np.float32)
            noise = np.rint(np.clip(profile.image_noise_std * noise, -255, 255))
            self._brighter = np.maximum(noise, 0.0).astype(np.uint8)
            self._darker = np.maximum(-noise, 0.0).astype(np.uint8)

    def degrade(self, image: NDArray[np.uint8], index: int, exposure: float) -> NDArray[np.uint8]:
        """Return an image with the errors of the camera.

        Args:
            image: clean image, (H, W, 3) RGB.
            index: number of the frame; selects the noise.
            exposure: relative brightness; 1 is correct.
        """
        result: NDArray[np.uint8] = np.array(image, order="C")  # a copy
        if self._sigma > 0.2:
            width = 3 if self._sigma < 0.8 else 2 * round(2.0 * self._sigma) + 1
            result = cv2.GaussianBlur(result, (width, width), self._sigma).astype(
                np.uint8, copy=False
            )
        if exposure != 1.0:
            result = cv2.convertScaleAbs(result, alpha=exposure).astype(np.uint8, copy=False)
        if self._brighter is not None:
            start = (index * _SCATTER) % _SLACK
            piece = slice(start, start + result.size)
            cv2.add(result, self._brighter[piece].reshape(result.shape), dst=result)
            cv2.subtract(result, self._darker[piece].reshape(result.shape), dst=result)
        return result
