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

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from uav_bt.errors import ShapeError
from uav_bt.types import CameraModel
from uav_bt.types.arrays import Floats, Image

Map = NDArray[np.float32]

_OUTSIDE = 1e3  # px, flow outside the image, which fails the loop test


@dataclass(frozen=True, kw_only=True)
class ParallaxConfig:
    """Which flows are accepted."""

    min_views: int = 2  # besides the frame, so that a wrong flow is detected
    min_parallax_px: float = 6.0  # root sum square; an error of half a pixel is 8 % of it
    max_misfit_px: float = 0.7  # root mean square residual
    max_loop_px: float = 0.8  # sum of forward and backward flow
    min_depth_m: float = 0.2
    max_depth_m: float = 4.0  # further away parallax is too small, and ground contact is in view


class Parallax:
    """Depth of one frame from its flow to others."""

    def __init__(
        self, grey: Image, camera: CameraModel, config: ParallaxConfig | None = None
    ) -> None:
        """Start without other frames.

        Args:
            grey: (H, W), the frame.
            camera: camera of all frames, at their size.
            config: which flows are accepted.

        Raises:
            ShapeError: the frame and the camera differ in size.
        """
        if grey.shape != (camera.height_px, camera.width_px):
            expected = f"{camera.height_px}x{camera.width_px}, as its camera"
            raise ShapeError("frame", expected=expected, actual=grey.shape)
        self._config = config or ParallaxConfig()
        self._grey = grey
        self._camera = camera
        self._flow = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)
        columns, rows = np.meshgrid(
            np.arange(camera.width_px, dtype=np.float32),
            np.arange(camera.height_px, dtype=np.float32),
        )
        self._pixels = np.stack([columns, rows], axis=2)
        self._rays = np.stack(
            [(columns - camera.cx_px) / camera.fx_px, (rows - camera.cy_px) / camera.fy_px]
        )
        # Sums over views of the least-squares problem slope * depth = shift, in pixels.
        self._slope_sq = np.zeros(grey.shape, np.float64)
        self._product = np.zeros(grey.shape, np.float64)
        self._terms: list[tuple[NDArray[np.bool_], Floats, Floats]] = []

    def add(self, grey: Image, motion: Floats) -> None:
        """Add another frame.

        Args:
            grey: (H, W), the other frame.
            motion: (3, 4), transform of points from the frame's camera to the other's, metres.
        """
        # With the rotation removed only parallax remains, so flows are short.
        turn = motion[:, :3]
        other, seen = self._turned(grey, turn)
        there = np.asarray(self._flow.calc(self._grey, other, self._nothing()), np.float32)
        back = np.asarray(self._flow.calc(other, self._grey, self._nothing()), np.float32)
        landed = self._pixels + there
        returned = np.asarray(
            cv2.remap(
                back,
                landed[..., 0],
                landed[..., 1],
                cv2.INTER_LINEAR,
                borderMode=cv2.BORDER_CONSTANT,
                borderValue=(_OUTSIDE, _OUTSIDE),
            )
        )
        loop = np.hypot(*np.moveaxis(there + returned, 2, 0))
        inside = cv2.remap(
            seen,
            landed[..., 0],
            landed[..., 1],
            cv2.INTER_NEAREST,
            borderMode=cv2.BORDER_CONSTANT,
            borderValue=(0,),
        )
        x = (landed[..., 0] - self._camera.cx_px) / self._camera.fx_px
        y = (landed[..., 1] - self._camera.cy_px) / self._camera.fy_px
        t = turn.T @ motion[:, 3]
        fx, fy = self._camera.fx_px, self._camera.fy_px
        # Divided by the depth, as in `depth`, these are in pixels of the other frame.
        slope = np.stack([fx * (self._rays[0] - x), fy * (self._rays[1] - y)])
        shift = np.stack([fx * (x * t[2] - t[0]), fy * (y * t[2] - t[1])])
        good = (loop < self._config.max_loop_px) & (np.asarray(inside) > 0)
        self._terms.append((good, slope, shift))
        self._slope_sq += good * (slope**2).sum(axis=0)
        self._product += good * (slope * shift).sum(axis=0)

    def _turned(self, grey: Image, turn: Floats) -> tuple[Image, Image]:
        """Return another frame rotated to this frame's attitude, and its valid pixels."""
        camera = self._camera
        matrix = np.array(
            [
                [camera.fx_px, 0.0, camera.cx_px],
                [0.0, camera.fy_px, camera.cy_px],
                [0.0, 0.0, 1.0],
            ]
        )
        homography = matrix @ turn @ np.linalg.inv(matrix)
        size = (camera.width_px, camera.height_px)
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        other = cv2.warpPerspective(grey, homography, size, flags=flags)
        seen = cv2.warpPerspective(np.full_like(grey, 255), homography, size, flags=flags)
        return np.asarray(other, np.uint8), np.asarray(seen == 255, np.uint8)

    def _nothing(self) -> Map:
        return np.zeros((*self._grey.shape, 2), np.float32)

    def depth(self) -> Map:
        """Return the depth along the optical axis, (H, W) metres; NaN where unknown."""
        config = self._config
        views = np.zeros(self._grey.shape, np.intp)
        misfit = np.zeros(self._grey.shape)
        parallax = np.zeros(self._grey.shape)
        solvable = self._slope_sq > 0.0
        depth = self._product / np.where(solvable, self._slope_sq, 1.0)
        within = solvable & (depth >= config.min_depth_m) & (depth <= config.max_depth_m)
        depth = np.where(within, depth, config.max_depth_m)  # avoids division by zero
        for good, slope, shift in self._terms:
            views += good
            # Pixels, to first order: the depth in the other frame is nearly the same.
            misfit += good * ((slope - shift / depth) ** 2).sum(axis=0)
            parallax += good * ((shift / depth) ** 2).sum(axis=0)
        known = (
            within
            & (views >= config.min_views)
            & (parallax >= config.min_parallax_px**2)
            & (misfit <= np.maximum(views, 1) * config.max_misfit_px**2)
        )
        return np.where(known, depth, np.nan).astype(np.float32)
