"""Labels of one frame from the scores of its plane sweep, before other frames are asked.

A large window beside a border takes the motion of the surface with the stronger texture. Ground is
therefore labelled by the smaller windows only, where nearly all of the window agrees; and no label
stands where the window also holds the opposite one.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.camera.ground_plane import CameraView, level_rays
from perception.segmentation.geometry.labels import GROUND, NOT_GROUND, UNKNOWN
from perception.segmentation.geometry.plane_sweep import SweepConfig, SweepScores

_HORIZON: Final = 0.01  # descent per unit of depth below which a ray counts as above the horizon


@dataclass(frozen=True, kw_only=True)
class SightingConfig:
    """Thresholds of the labels. Numbers are chosen on training scenes.

    Attributes:
        similarity: Least similarity of the best plane.
        ground_margin: Least difference from the best other plane, for ground.
        other_margin: The same for not ground.
        ground_windows: Number of the smallest windows that label ground.
        ground_share: Least share of the window that agrees on ground.
        other_share: Least share of half of the window that agrees on not ground.
        opposite_share: Largest share of the window with the opposite label.
    """

    similarity: float = 0.5
    ground_margin: float = 0.15
    other_margin: float = 0.15
    ground_windows: int = 2
    ground_share: float = 0.7
    other_share: float = 0.5
    opposite_share: float = 0.02


def above_horizon(view: CameraView) -> NDArray[np.bool_]:
    """Return where the rays of a view never meet the ground, (H, W)."""
    return np.asarray(level_rays(view)[2] <= _HORIZON)


def sighted(
    scores: SweepScores,
    view: CameraView,
    config: SightingConfig | None = None,
    planes: SweepConfig | None = None,
) -> NDArray[np.uint8]:
    """Return the labels that one plane sweep and the horizon give, (H, W) uint8.

    Args:
        scores: of the sweep.
        view: camera of the frame at that size, height and pitch.
        config: thresholds.
        planes: configuration of the sweep.
    """
    config, planes = config or SightingConfig(), planes or SweepConfig()
    # Ground needs alternatives: without parallax every plane explains the frames.
    tested = scores.parallax_px * planes.largest >= 2.0 * planes.off_ground_px
    grounds, others = [], []
    for ground, above, below in zip(scores.ground, scores.above, scores.below, strict=True):
        beaten = np.maximum(above, below)
        grounds.append(
            (ground > config.similarity) & (ground - beaten > config.ground_margin) & tested
        )
        beaten = np.maximum(ground, below)
        others.append((above > config.similarity) & (above - beaten > config.other_margin))
    labels = np.full(scores.parallax_px.shape, UNKNOWN, np.uint8)
    for index, side in enumerate(planes.windows_px):
        half = side // 4  # of half the window
        agreeing = _share(others[index], half) >= config.other_share
        opposed = _share(grounds[index], half) > config.opposite_share
        near = _share(np.any(grounds[: index + 1], axis=0), half) > 0.0
        other = others[index] & agreeing & ~opposed & ~near
        ground = np.zeros_like(other)
        if index < config.ground_windows:
            agreeing = _share(grounds[index], side // 2) >= config.ground_share
            opposed = _share(others[index], side // 2) > config.opposite_share
            near = _share(np.any(others[: index + 1], axis=0), half) > 0.0
            ground = grounds[index] & agreeing & ~opposed & ~near
        new = np.where(ground, GROUND, np.where(other, NOT_GROUND, UNKNOWN))
        labels = np.where(labels == UNKNOWN, new, labels).astype(np.uint8)
    labels[above_horizon(view)] = NOT_GROUND
    return labels


def _share(mask: NDArray[np.bool_], half: int) -> NDArray[np.float32]:
    """Return the share of true pixels in the square around each pixel."""
    side = (2 * half + 1, 2 * half + 1)
    return np.asarray(cv2.blur(mask.astype(np.float32), side), np.float32)
