"""The twin's camera: where it is, and the blur, exposure and noise it adds to a clean image."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from sim_bridge.twin.noise import child_seed
from sim_bridge.twin.profile import Profile
from uav_bt.types import Pose

_REFERENCE_WIDTH_PX = 640  # the width at which `Profile.blur_sigma_px` is meant
_SLACK = 1 << 17  # how far the noise may be shifted from frame to frame
_SCATTER = 2654435761  # Knuth's multiplicative hash: neighbouring frames get different noise


@dataclass(frozen=True, kw_only=True, slots=True)
class CameraPose(Pose):
    """Where the lens is and where it looks; the gimbal keeps the horizon level."""

    pitch_rad: float  # 0 level, negative down

    def axes(self) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
        """Return the optical axis and the image's upward direction in the world."""
        cy, sy = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        cp, sp = math.cos(self.pitch_rad), math.sin(self.pitch_rad)
        return (cp * cy, cp * sy, sp), (-sp * cy, -sp * sy, cp)


class Optics:
    """Applies a camera's blur, exposure and noise to images of one size, the same every time.

    Noise is drawn once; each frame uses it from another offset on, which takes a tenth of the time
    of drawing it anew.

    Args:
        profile: how strong they are.
        width_px: of the images.
        height_px: of the images.
        seed: of the noise.
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
        """Return the image as the camera sends it.

        Args:
            image: clean image, (H, W, 3) RGB.
            index: the frame's number, which decides its noise.
            exposure: relative brightness, 1 is correct.
        """
        result: NDArray[np.uint8] = np.array(image, order="C")  # the caller keeps the clean one
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
