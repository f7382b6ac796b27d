"""Depth labels from camera motion: triangulated dense optical flow.

Geometry on masks does not give the depth of a box whose base is out of the image. Such boxes are
near and move most between frames. Between frames with precisely known camera motion
(`perception.odometry.visual`), the flow of a pixel gives its depth:

    flowed pixel = (ray d + t) projected

with t the translation along the axes of the frame's camera. The equation is linear in the depth d,
once for columns and once for rows. Several frames are combined by least squares. Pixels with large
residuals or too little parallax stay unknown.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

import cv2
import numpy as np

from uav_bt.types import CameraModel
from uav_bt.types.arrays import Flags, Floats, Floats32, Image

_MIN_VIEWS: Final = 2  # besides the frame, so that a wrong flow is detected
_MIN_PARALLAX_PX: Final = 6.0  # root sum square; an error of half a pixel is 8 % of it
_MAX_MISFIT_PX: Final = 0.7  # root mean square residual
_MAX_LOOP_PX: Final = 0.8  # sum of forward and backward flow
_MIN_DEPTH_M: Final = 0.2
_MAX_DEPTH_M: Final = 4.0  # further away parallax is too small, and ground contact is in view
_OUTSIDE: Final = 1e3  # px, flow outside the image, which fails the loop test


def parallax_depth(
    grey: Image, camera: CameraModel, others: Iterable[tuple[Image, Floats]]
) -> Floats32:
    """Return a frame's depth from its flow to others.

    Args:
        grey: (H, W), the frame.
        camera: camera of all frames, at their size.
        others: images, (H, W), each with the transform of points from the frame's camera to that
            image's, (3, 4), metres.

    Returns:
        (H, W) metres along the optical axis; NaN where unknown.
    """
    terms = [_term(grey, camera, other, motion) for other, motion in others]
    # Sums over views of the least-squares problem slope * depth = shift, in pixels.
    slope_sq, product, misfit, parallax = np.zeros((4, *grey.shape))
    views = np.zeros(grey.shape, np.intp)
    for good, slope, shift in terms:
        slope_sq += good * (slope**2).sum(axis=0)
        product += good * (slope * shift).sum(axis=0)
    solvable = slope_sq > 0.0
    depth = product / np.where(solvable, slope_sq, 1.0)
    within = solvable & (depth >= _MIN_DEPTH_M) & (depth <= _MAX_DEPTH_M)
    depth = np.where(within, depth, _MAX_DEPTH_M)  # avoids division by zero
    for good, slope, shift in terms:
        views += good
        # Pixels, to first order: the depth in the other frame is nearly the same.
        misfit += good * ((slope - shift / depth) ** 2).sum(axis=0)
        parallax += good * ((shift / depth) ** 2).sum(axis=0)
    known = (
        within
        & (views >= _MIN_VIEWS)
        & (parallax >= _MIN_PARALLAX_PX**2)
        & (misfit <= np.maximum(views, 1) * _MAX_MISFIT_PX**2)
    )
    return np.where(known, depth, np.nan).astype(np.float32)


def _term(
    grey: Image, camera: CameraModel, other: Image, motion: Floats
) -> tuple[Flags, Floats, Floats]:
    """Return where the flow to another frame is good, (H, W), and slope and shift, (2, H, W)."""
    # With the rotation removed only parallax remains, so flows are short.
    turn, size = motion[:, :3], grey.shape[::-1]
    homography = camera.matrix @ turn @ np.linalg.inv(camera.matrix)
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    seen = cv2.warpPerspective(np.full_like(other, 255), homography, size, flags=flags) == 255
    other = np.asarray(cv2.warpPerspective(other, homography, size, flags=flags), np.uint8)
    flow = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)
    there = flow.calc(grey, other, np.zeros((*grey.shape, 2), np.float32))
    back = flow.calc(other, grey, np.zeros((*grey.shape, 2), np.float32))
    columns, rows = np.meshgrid(*(np.arange(side, dtype=np.float32) for side in size))
    x_px, y_px = columns + there[..., 0], rows + there[..., 1]
    returned = cv2.remap(
        back, x_px, y_px, cv2.INTER_LINEAR, None, cv2.BORDER_CONSTANT, (_OUTSIDE, _OUTSIDE)
    )
    inside = cv2.remap(seen.astype(np.uint8), x_px, y_px, cv2.INTER_NEAREST)
    loop = np.hypot(*np.moveaxis(there + returned, 2, 0))
    fx, fy, cx, cy = camera.pinhole_px
    x, y = (x_px - cx) / fx, (y_px - cy) / fy
    t = turn.T @ motion[:, 3]
    # Divided by the depth, these are in pixels of the other frame.
    slope = np.stack([fx * ((columns - cx) / fx - x), fy * ((rows - cy) / fy - y)])
    shift = np.stack([fx * (x * t[2] - t[0]), fy * (y * t[2] - t[1])])
    return (loop < _MAX_LOOP_PX) & (inside > 0), slope, shift
