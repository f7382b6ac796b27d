"""Ground-plane visual odometry: motion between two frames from the ground in view.

The drone's velocity has errors of a centimetre per second for several seconds, which add up to a
quarter of a metre in half a minute. The points of the ground are fixed and lie in a known plane.
Tracked between two frames by optical flow (Lucas and Kanade), they give the horizontal motion and
the turn. Telemetry's heading has an error of half a degree, which moves an image by more than two
pixels; the turn from the ground has a fraction of that error. `GroundOdometry`
(`perception.odometry.ground`) combines this with dead reckoning in flight.

On a floor of one colour the corners are image noise. Their flow ends where it began, at the guess,
so that they agree with one another and with telemetry. Points of the ground are therefore tracked
from two guesses: a motion that depends on the guess is none.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import cv2
import numpy as np

from uav_bt.compiled import compiled
from uav_bt.types import (
    CameraModel,
    Pose2D,
    rotate_points,
)
from uav_bt.types.arrays import Floats, Floats32, Image
from uav_bt.types.projection import ground_points, project


@dataclass(frozen=True, kw_only=True)
class OdometryConfig:
    """How points are found, tracked and weighted."""

    points: int = 150  # tracked at most; more only cost time
    quality: float = 0.02  # relative to the strongest corner; the ground has low contrast
    spacing_px: int = 5  # least distance between points
    window_px: int = 15  # of the optical flow
    max_range_m: float = 4.0  # points on ground further away are too inaccurate
    inlier_m: float = 0.03  # largest residual on the ground; points on boxes have larger ones
    min_points: int = 20  # fewer inliers give no motion
    # With a ground mask, fewer inliers of the tracked points give none either. On textured ground
    # 99 % of the motions have more than 0.8.
    min_share: float = 0.6
    # With a ground mask, points are tracked from two guesses that are apart by twice this share of
    # the height, ahead and to the right. Texture gives the same motion (95 % differ by less than
    # 0.05 of the guesses' distance); the noise of a plain floor follows the guess (more than 0.38).
    apart: float = 0.0133
    max_dependence: float = 0.2  # largest difference of the motions, relative to the guesses'
    min_spread_m: float = 0.3  # points closer together give no motion: turn and shift look alike
    rounds: int = 6  # of fitting and reweighting
    # Largest relative error between the two heights, corrected if a ground mask is given. With
    # points on boxes, a scale would absorb their motion.
    max_scale: float = 0.02
    # A motion that differs from telemetry by more than these was not measured on the ground.
    max_yaw_rad: float = 0.1
    max_shift_m: float = 0.12

    def believes(self, measured: Pose2D, expected: Pose2D) -> bool:
        """Return whether a measurement agrees with telemetry."""
        shift_m = math.hypot(measured.x_m - expected.x_m, measured.y_m - expected.y_m)
        return abs(measured.yaw_rad - expected.yaw_rad) <= self.max_yaw_rad and (
            shift_m <= self.max_shift_m
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class GroundView:
    """Odometry's input from one frame."""

    grey: Image  # (H, W)
    camera: CameraModel  # at that size
    gimbal_pitch_rad: float
    height_m: float  # of the lens above the ground


class GroundMotion(NamedTuple):
    """Motion of a camera over the ground between two frames."""

    motion: Pose2D  # pose of the second camera in the level frame of the first
    spread_m: float  # root mean square of the points around their middle; wider is more accurate


def ground_motion(
    first: GroundView,
    second: GroundView,
    guess: Pose2D,
    ground: Image | None = None,
    config: OdometryConfig | None = None,
) -> GroundMotion | None:
    """Measure the pose of the second camera in the level frame of the first.

    Args:
        first: the frame in which points are selected.
        second: the frame in which they are tracked.
        guess: the motion by telemetry, the start of the search; x forward, y right, yaw clockwise.
        ground: (H, W) uint8, not zero where the first frame shows ground; None without a mask, so
            that only the robust fit rejects other points.
        config: how points are found.

    Returns:
        The motion; None with too few points on the ground, and on ground without texture.
    """
    config = config or OdometryConfig()
    corners = cv2.goodFeaturesToTrack(
        first.grey, config.points, config.quality, config.spacing_px, mask=ground
    )
    if corners is None or len(corners) < config.min_points:
        return None
    corners = corners.reshape(-1, 2)
    here = ground_points(corners, first.camera, first.gimbal_pitch_rad, first.height_m)
    near = np.hypot(*here.T) < config.max_range_m
    begin, here = corners[near].astype(np.float32), here[near]
    if ground is None:  # points on objects are outliers then
        config = replace(config, max_scale=0.0, min_share=0.0)
        return _tracked(begin, here, (first, second), guess, config)
    apart_m = config.apart * second.height_m
    low = _tracked(begin, here, (first, second), guess, config, shift_m=-apart_m)
    high = _tracked(begin, here, (first, second), guess, config, shift_m=apart_m)
    if low is None or high is None:
        return None
    x_m, y_m = high.motion.x_m - low.motion.x_m, high.motion.y_m - low.motion.y_m
    if math.hypot(x_m, y_m) > config.max_dependence * 2.0 * math.sqrt(2.0) * apart_m:
        return None
    return GroundMotion(low.motion.towards(high.motion, 0.5), min(low.spread_m, high.spread_m))


def _tracked(
    begin: Floats32,
    here: Floats,
    views: tuple[GroundView, GroundView],
    guess: Pose2D,
    config: OdometryConfig,
    *,
    shift_m: float = 0.0,
) -> GroundMotion | None:
    """Track points and fit their motion.

    Args:
        begin: (N, 2) pixels in the first frame.
        here: (N, 2) the same points on the ground, in the level frame of the first camera, m.
        views: the frame of the points, and the one in which they are tracked.
        guess: the motion by telemetry.
        config: how they are tracked.
        shift_m: of the guess from which they are tracked, ahead and to the right.
    """
    first, second = views
    start = replace(guess, x_m=guess.x_m + shift_m, y_m=guess.y_m + shift_m)
    level = np.column_stack([_moved(here, start), np.full(len(here), second.height_m)])
    expected = project(level, second.camera, second.gimbal_pitch_rad)
    usable = np.isfinite(expected).all(axis=1)
    if np.count_nonzero(usable) < config.min_points:
        return None
    found, status, _ = cv2.calcOpticalFlowPyrLK(
        first.grey,
        second.grey,
        begin[usable],
        expected[usable].astype(np.float32),
        winSize=(config.window_px, config.window_px),
        maxLevel=2,
        flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
    )
    there = ground_points(found, second.camera, second.gimbal_pitch_rad, second.height_m)
    good = (status.ravel() == 1) & np.isfinite(there).all(axis=1)
    return _fitted(here[usable][good], there[good], guess, config)


def _moved(points: Floats, motion: Pose2D) -> Floats:
    return rotate_points(points, -motion.yaw_rad) + motion.to_body(0.0, 0.0)


def _fitted(
    here: Floats, there: Floats, guess: Pose2D, config: OdometryConfig
) -> GroundMotion | None:
    """Fit a motion of the plane by iterative reweighting, which rejects points off the plane."""
    if len(here) < config.min_points:
        return None
    # The guess may have a common error: remove the median shift before weighting points.
    residual_m = there - _moved(here, guess)
    residual_m -= np.median(residual_m, axis=0)
    x_m, y_m, yaw_rad, spread_m, inliers = _reweighted(
        here, there, residual_m, config.inlier_m, config.max_scale, config.rounds
    )
    motion = Pose2D(x_m=x_m, y_m=y_m, yaw_rad=yaw_rad)
    least = max(config.min_points, config.min_share * len(here))
    enough = inliers >= least and spread_m >= config.min_spread_m
    return GroundMotion(motion, spread_m) if enough and config.believes(motion, guess) else None


@compiled(
    "Tuple((float64, float64, float64, float64, int64))"
    "(float64[:, ::1], float64[:, ::1], float64[:, ::1], float64, float64, int64)"
)
def _reweighted(  # noqa: PLR0917 - Numba passes arguments by position
    here: Floats,
    there: Floats,
    residual_m: Floats,
    inlier_m: float,
    max_scale: float,
    rounds: int,
) -> tuple[float, float, float, float, int]:
    """Fit a motion of the plane by rounds of weighted least squares (Umeyama, in the plane).

    The scale absorbs the error of the second height relative to the first, which would otherwise
    appear as forward motion. OpenCV's `estimateAffinePartial2D` has no weights, and SciPy's
    `Rotation.align_vectors` works in three dimensions without the translation.

    Args:
        here: (N, 2) points in the level frame of the first camera, m.
        there: (N, 2) the same points in that of the second, m.
        residual_m: (N, 2) differences by which the points are first weighted, m; overwritten.
        inlier_m: largest residual of an inlier.
        max_scale: largest relative error of the second height.
        rounds: of fitting and reweighting.

    Returns:
        Pose of the second camera in the level frame of the first: x, y, yaw; root mean square of
        the points around their middle, m; number of inliers.
    """
    x_m, y_m, yaw_rad, spread_m2 = 0.0, 0.0, 0.0, 0.0
    weights = np.empty(len(here))
    scale_m = 4.0 * inlier_m
    for _ in range(rounds):
        total, from_x, from_y, to_x, to_y = 0.0, 0.0, 0.0, 0.0, 0.0
        for point in range(len(here)):
            # The error of one pixel on the ground grows with the square of the distance.
            range_m2 = there[point, 0] ** 2 + there[point, 1] ** 2
            off = (residual_m[point, 0] / scale_m) ** 2 + (residual_m[point, 1] / scale_m) ** 2
            weight = 1.0 / (1.0 + range_m2) ** 2 / (1.0 + off) ** 2
            weights[point] = weight
            total += weight
            from_x, from_y = from_x + weight * here[point, 0], from_y + weight * here[point, 1]
            to_x, to_y = to_x + weight * there[point, 0], to_y + weight * there[point, 1]
        from_x, from_y, to_x, to_y = from_x / total, from_y / total, to_x / total, to_y / total
        across, along, spread_m2 = 0.0, 0.0, 0.0
        for point in range(len(here)):
            share = weights[point] / total
            ax, ay = here[point, 0] - from_x, here[point, 1] - from_y
            bx, by = there[point, 0] - to_x, there[point, 1] - to_y
            # Points turn opposite to the camera, and y is to the right: signs of a clockwise
            # heading.
            across += share * (ay * bx - ax * by)
            along += share * (ax * bx + ay * by)
            spread_m2 += share * (bx * bx + by * by)
        yaw_rad = math.atan2(across, along)
        scale = math.hypot(across, along) / spread_m2 if spread_m2 > 0.0 else 1.0
        scale = min(max(scale, 1.0 - max_scale), 1.0 + max_scale)
        cos, sin = math.cos(yaw_rad), math.sin(yaw_rad)
        x_m = from_x - scale * (cos * to_x - sin * to_y)
        y_m = from_y - scale * (sin * to_x + cos * to_y)
        for point in range(len(here)):
            off_x, off_y = here[point, 0] - x_m, here[point, 1] - y_m
            residual_m[point, 0] = scale * there[point, 0] - (cos * off_x + sin * off_y)
            residual_m[point, 1] = scale * there[point, 1] - (cos * off_y - sin * off_x)
        scale_m = max(inlier_m, 0.6 * scale_m)
    inliers = 0
    for point in range(len(here)):
        inliers += math.hypot(residual_m[point, 0], residual_m[point, 1]) < inlier_m
    return x_m, y_m, yaw_rad, math.sqrt(spread_m2), inliers
