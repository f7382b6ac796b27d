"""Ground-plane visual odometry: dead reckoning, corrected by the carpet in view.

The drone's own velocity is off by a centimetre a second for seconds on end, which adds up to a
quarter of a metre in half a minute. The carpet stands still, and its points lie in a known plane:
two frames of them, followed by optical flow (Lucas and Kanade), give the horizontal movement, and
the heading to a fraction of the half degree by which telemetry's is wrong (which moves an image by
more than two pixels, more than depth does at some metres). `CarpetOdometry`
(`perception.odometry.carpet`) uses both in flight.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np

from uav_bt.types import (
    CameraModel,
    Pose2D,
    rotate_points,
    rotation,
)
from uav_bt.types.arrays import Floats, Image
from uav_bt.types.projection import ground_points, project


@dataclass(frozen=True, kw_only=True)
class OdometryConfig:
    """How points are found, followed and trusted."""

    points: int = 150  # followed at most; more only cost time
    quality: float = 0.02  # of the strongest corner's; the carpet's texture is faint
    spacing_px: int = 5
    window_px: int = 15  # of the optical flow
    max_range_m: float = 4.0  # further carpet is seen too flatly to say much
    inlier_m: float = 0.03  # on the ground; boxes' points move by more
    min_points: int = 20  # with fewer, telemetry stays,
    min_spread_m: float = 0.3  # and with points closer together: they tell no turn from a shift
    rounds: int = 6  # of fitting and weighing
    # By which the second height may be wrong against the first, where all points are on the carpet;
    # among others, a scale would take up their movement.
    max_scale: float = 0.02
    # What differs more from telemetry than it can be wrong was measured on something else.
    max_yaw_rad: float = 0.1
    max_shift_m: float = 0.12

    def believes(self, measured: Pose2D, expected: Pose2D) -> bool:
        """Return whether a measurement is near enough to telemetry."""
        shift_m = math.hypot(measured.x_m - expected.x_m, measured.y_m - expected.y_m)
        return abs(measured.yaw_rad - expected.yaw_rad) <= self.max_yaw_rad and (
            shift_m <= self.max_shift_m
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class GroundView:
    """One frame as odometry sees it."""

    grey: Image  # (H, W)
    camera: CameraModel  # at that size
    gimbal_pitch_rad: float
    height_m: float  # of the lens above the carpet


class GroundMotion(NamedTuple):
    """How a camera moved over the ground between two frames."""

    motion: Pose2D  # of the second camera in the level frame of the first
    spread_m: float  # of the points around their middle, root mean square: the wider, the surer


def ground_motion(
    first: GroundView,
    second: GroundView,
    guess: Pose2D,
    carpet: Image | None = None,
    config: OdometryConfig | None = None,
) -> GroundMotion | None:
    """Measure where the second camera is in the level frame of the first.

    Args:
        first: where points are picked.
        second: where they are found again.
        guess: the movement by telemetry, where the search begins; x forward, y right, yaw
            clockwise.
        carpet: (H, W), not zero where the first frame shows carpet; None to let the fit find out.
        config: how points are found.

    Returns:
        The movement; None with too few points on the carpet.
    """
    config = config or OdometryConfig()
    corners = cv2.goodFeaturesToTrack(
        first.grey, config.points, config.quality, config.spacing_px, mask=carpet
    )
    if corners is None or len(corners) < config.min_points:
        return None
    corners = corners.reshape(-1, 2)
    here = ground_points(corners, first.camera, first.gimbal_pitch_rad, first.height_m)
    guessed = _moved(here, guess)
    level = np.column_stack([guessed, np.full(len(guessed), second.height_m)])
    expected = project(level, second.camera, second.gimbal_pitch_rad)
    usable = np.isfinite(expected).all(axis=1) & (np.hypot(*here.T) < config.max_range_m)
    if np.count_nonzero(usable) < config.min_points:
        return None
    begin = corners[usable].astype(np.float32)
    found, status, _ = cv2.calcOpticalFlowPyrLK(
        first.grey,
        second.grey,
        begin,
        expected[usable].astype(np.float32),
        winSize=(config.window_px, config.window_px),
        maxLevel=2,
        flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
    )
    tracked = status.ravel() == 1
    here = here[usable][tracked]
    there = ground_points(found[tracked], second.camera, second.gimbal_pitch_rad, second.height_m)
    good = np.isfinite(there).all(axis=1)
    max_scale = 0.0 if carpet is None else config.max_scale
    return _fitted(here[good], there[good], guess, config, max_scale)


def _moved(points: Floats, motion: Pose2D) -> Floats:
    return rotate_points(points, -motion.yaw_rad) + motion.to_body(0.0, 0.0)


def _fitted(
    here: Floats, there: Floats, guess: Pose2D, config: OdometryConfig, max_scale: float
) -> GroundMotion | None:
    """Fit a movement of the plane, reweighted so that other points lose their weight."""
    if len(here) < config.min_points:
        return None
    # Far points are measured worse: an error of a pixel grows with the square of the distance.
    trust = 1.0 / (1.0 + (there**2).sum(axis=1)) ** 2
    scale_m = 4.0 * config.inlier_m
    # The guess may be off as a whole: take the common shift away before points are judged.
    residual = there - _moved(here, guess)
    centre = np.median(residual, axis=0)
    weight = trust / (1.0 + (((residual - centre) / scale_m) ** 2).sum(axis=1)) ** 2
    for _ in range(config.rounds):
        found, scale = _similarity(here, there, weight, max_scale)
        residual = scale * there - _moved(here, found.motion)
        scale_m = max(config.inlier_m, 0.6 * scale_m)
        weight = trust / (1.0 + ((residual / scale_m) ** 2).sum(axis=1)) ** 2
    inliers = np.count_nonzero(np.hypot(*residual.T) < config.inlier_m)
    enough = inliers >= config.min_points and found.spread_m >= config.min_spread_m
    return found if enough and config.believes(found.motion, guess) else None


def _similarity(
    here: Floats, there: Floats, weight: Floats, max_scale: float
) -> tuple[GroundMotion, float]:
    """Return the weighted least-squares motion, and the scale (Umeyama, in the plane).

    The scale takes up what the second height is wrong against the first, which would pass for a way
    ahead. OpenCV's `estimateAffinePartial2D` has no weights, and SciPy's `Rotation.align_vectors`
    works in three dimensions without the translation.
    """
    share = weight / weight.sum()
    from_, to = share @ here, share @ there
    a, b = here - from_, there - to
    # Points turn counter to the camera, and y is to the right: the signs of a clockwise heading.
    across = float(share @ (a[:, 1] * b[:, 0] - a[:, 0] * b[:, 1]))
    along = float(share @ (a[:, 0] * b[:, 0] + a[:, 1] * b[:, 1]))
    yaw_rad, spread_m2 = math.atan2(across, along), float(share @ (b**2).sum(axis=1))
    scale = math.hypot(across, along) / spread_m2 if spread_m2 > 0.0 else 1.0
    scale = min(max(scale, 1.0 - max_scale), 1.0 + max_scale)
    origin = from_ - rotation(yaw_rad) @ (scale * to)
    motion = Pose2D(x_m=float(origin[0]), y_m=float(origin[1]), yaw_rad=yaw_rad)
    return GroundMotion(motion, math.sqrt(spread_m2)), scale
