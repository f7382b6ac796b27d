"""One training example, and augmentations that keep it consistent."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from uav_bt.types.arrays import Floats32


@dataclass(frozen=True, kw_only=True, eq=False)
class Clip:
    """A target frame and two reference frames, target first."""

    images: Floats32  # (3, 3, H, W), RGB, 0 to 1
    motions: Floats32  # (2, 3, 4), transforms from the target's camera to the references', metres
    intrinsics: Floats32  # (4,): fx, fy, cx, cy in pixels of the images
    labels: Floats32 | None  # (3, h, w); NaN where unknown
    at_most: Floats32 | None  # (3, h, w); inf without a bound


def turned(clip: Clip, pitch_rad: float, roll_rad: float = 0.0) -> Clip:
    """Return the clip of a camera rotated about its lens.

    Args:
        clip: the original clip.
        pitch_rad: rotation of the optical axis, upwards positive.
        roll_rad: rotation about the optical axis, right side down positive.

    Returns:
        Frames, motions and labels of the rotated camera. Outside the original frames, images are
        mirrored and labels are unknown.
    """
    c, s = math.cos(pitch_rad), math.sin(pitch_rad)
    up = np.array([[1.0, 0.0, 0.0], [0.0, c, s], [0.0, -s, c]])
    c, s = math.cos(roll_rad), math.sin(roll_rad)
    turn = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]) @ up
    fx, fy, cx, cy = (float(value) for value in clip.intrinsics)
    height, width = clip.images.shape[2:]
    matrix = np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
    homography = matrix @ turn @ np.linalg.inv(matrix)
    images = [
        cv2.warpPerspective(
            np.ascontiguousarray(image.transpose(1, 2, 0)),
            homography,
            (width, height),
            flags=cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_REFLECT,
        ).transpose(2, 0, 1)
        for image in clip.images
    ]
    rotations = turn @ clip.motions[:, :, :3] @ turn.T
    translations = turn @ clip.motions[:, :, 3:]
    return replace(
        clip,
        images=np.ascontiguousarray(np.stack(images), dtype=np.float32),
        motions=np.concatenate([rotations, translations], axis=2).astype(np.float32),
        labels=_turned_maps(clip.labels, clip, turn, np.nan),
        at_most=_turned_maps(clip.at_most, clip, turn, np.inf),
    )


def _turned_maps(
    maps: Floats32 | None, clip: Clip, turn: NDArray[np.float64], beyond: float
) -> Floats32 | None:
    """Rotate depth maps: pixels move, and depths change to the new optical axis."""
    if maps is None:
        return None
    height, width = maps.shape[1:]
    x_scale, y_scale = width / clip.images.shape[3], height / clip.images.shape[2]
    fx, fy, cx, cy = (float(value) for value in clip.intrinsics)
    fx, fy = fx * x_scale, fy * y_scale
    cx, cy = (cx + 0.5) * x_scale - 0.5, (cy + 0.5) * y_scale - 0.5
    columns, rows = np.meshgrid(np.arange(width), np.arange(height))
    rays = np.stack([(columns - cx) / fx, (rows - cy) / fy, np.ones(columns.shape)])
    before = np.tensordot(turn.T, rays, axes=1)
    nearer = np.maximum(before[2], 1e-3)  # depth along the old axis for one along the new
    columns = np.asarray(fx * before[0] / nearer + cx, dtype=np.float32)
    rows = np.asarray(fy * before[1] / nearer + cy, dtype=np.float32)
    result = [
        cv2.remap(
            each,
            columns,
            rows,
            cv2.INTER_NEAREST,
            borderMode=cv2.BORDER_CONSTANT,
            borderValue=(beyond,),
        )
        / nearer
        for each in maps
    ]
    return np.asarray(np.stack(result), dtype=np.float32)


def mirrored(clip: Clip) -> Clip:
    """Return the clip of a camera in a mirrored world."""
    fx, fy, cx, cy = clip.intrinsics
    sign = np.array([-1.0, 1.0, 1.0], dtype=np.float32)
    rotations = sign[:, None] * clip.motions[:, :, :3] * sign
    translations = sign[:, None] * clip.motions[:, :, 3:]

    def flipped(array: Floats32) -> Floats32:
        return np.ascontiguousarray(array[..., ::-1])

    return Clip(
        images=flipped(clip.images),
        motions=np.concatenate([rotations, translations], axis=2),
        intrinsics=np.array([fx, fy, clip.images.shape[-1] - 1 - cx, cy], dtype=np.float32),
        labels=None if clip.labels is None else flipped(clip.labels),
        at_most=None if clip.at_most is None else flipped(clip.at_most),
    )


def recoloured(clip: Clip, gains: NDArray[np.float64]) -> Clip:
    """Return the clip in another light, equal for all frames.

    Args:
        clip: the original clip.
        gains: (3,) factors of red, green and blue.
    """
    images = np.clip(clip.images * gains.astype(np.float32)[:, None, None], 0.0, 1.0)
    return replace(clip, images=images)
