"""Small changes to training pictures: colour within the paper's limits, shift and rotation.

Mocanu et al. (arXiv 2510.16624): hue by up to 5 degrees, saturation by 2 %, value by 6 %, random
translations and rotations; stronger colour changes hurt, because colour is what tells the patterns
apart. No mirroring: a pattern keeps its handedness in the lab.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from uav_bt.errors import ShapeError, ValueRangeError

_HUE_LEVEL_DEG: Final = 2.0  # OpenCV's 8-bit hue counts in steps of two degrees


@dataclass(frozen=True, kw_only=True)
class AugmentConfig:
    """How far a training picture may be changed; each draw is uniform within plus and minus."""

    hue_deg: float = 5.0  # the paper's
    saturation: float = 0.02  # relative, the paper's
    value: float = 0.06  # relative, the paper's
    rotation_deg: float = 8.0  # the paper gives none; a stabilised camera rolls little
    shift: float = 0.1  # of the picture's sides; the paper gives none

    def __post_init__(self) -> None:
        if min(self.hue_deg, self.saturation, self.value, self.rotation_deg, self.shift) < 0.0:
            raise ValueRangeError(f"augmentation limits must not be negative, got {self}")


def augmented(
    rgb: NDArray[np.uint8],
    ids: NDArray[np.uint8],
    rng: np.random.Generator,
    config: AugmentConfig,
) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """Return a changed picture and its equally moved class ids.

    What comes in from outside the picture is its mirror image, in both alike.

    Args:
        rgb: (H, W, 3) uint8.
        ids: (H, W) uint8.
        rng: draws the changes.
        config: their limits.

    Raises:
        ShapeError: picture and ids differ in size.
    """
    height, width = rgb.shape[:2]
    if ids.shape != (height, width):
        raise ShapeError("class ids", expected=f"{height}x{width}", actual=ids.shape)
    hue, saturation, value, angle, across, down = rng.uniform(-1.0, 1.0, size=6).tolist()
    hsv = cv2.cvtColor(rgb, cv2.COLOR_RGB2HSV)
    table = np.stack(
        [
            np.round(np.arange(256) + hue * config.hue_deg / _HUE_LEVEL_DEG) % 180,
            np.clip(np.round(np.arange(256) * (1.0 + saturation * config.saturation)), 0, 255),
            np.clip(np.round(np.arange(256) * (1.0 + value * config.value)), 0, 255),
        ],
        axis=1,
    ).astype(np.uint8)[None]
    coloured = cv2.cvtColor(cv2.LUT(hsv, table), cv2.COLOR_HSV2RGB)
    turn = cv2.getRotationMatrix2D(
        ((width - 1) / 2.0, (height - 1) / 2.0), angle * config.rotation_deg, 1.0
    )
    turn[:, 2] += (across * config.shift * width, down * config.shift * height)
    size, border = (width, height), cv2.BORDER_REFLECT_101
    moved = cv2.warpAffine(coloured, turn, size, flags=cv2.INTER_LINEAR, borderMode=border)
    moved_ids = cv2.warpAffine(ids, turn, size, flags=cv2.INTER_NEAREST, borderMode=border)
    return np.asarray(moved, dtype=np.uint8), np.asarray(moved_ids, dtype=np.uint8)
