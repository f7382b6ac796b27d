"""Ground-plane visual odometry: motion between two frames from the ground in view.

The drone's velocity has errors of a centimetre per second for several seconds, which add up to a
quarter of a metre in half a minute. The points of the ground are fixed and lie in a known plane.
Tracked between two frames by optical flow (Lucas and Kanade), they give the horizontal motion and
the turn, with a fraction of the error of telemetry's heading, half a degree.

On a floor of one colour the corners are image noise. Their flow ends where it began, at the guess,
so that they agree with one another and with telemetry. Points of the ground are therefore tracked
from two guesses, and a motion that depends on the guess is left out.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final, NamedTuple

import cv2
import numpy as np

from uav_bt.compiled import compiled
from uav_bt.types import CameraModel, Pose2D, rotate_points
from uav_bt.types.arrays import Floats, Floats32, Image
from uav_bt.types.projection import ground_points, project

_POINTS: Final = 150  # tracked at most; more only cost time
# Least strength of a corner, relative to the strongest. In a ground mask the strongest may be the
# edge of an object that the class map calls ground; with a low value the ground counts beside it.
_QUALITY: Final = 0.02
_QUALITY_IN_MASK: Final = 0.001
_SPACING_PX: Final = 5  # least distance between points
_WINDOW_PX: Final = 15  # of the optical flow
TRACKED_RANGE_M: Final = 4.0  # points on ground further away are too inaccurate
_INLIER_M: Final = 0.03  # largest residual on the ground; points on boxes have larger ones
_MIN_POINTS: Final = 20  # fewer inliers give no motion
# With a ground mask, fewer inliers of the tracked points give none either. On textured ground 99 %
# of the motions have more than 0.8.
_MIN_SHARE: Final = 0.6
# With a ground mask, points are tracked from two guesses that are apart by twice this share of the
# height, ahead and to the right. Texture gives the same motion (95 % differ by less than 0.05 of
# the guesses' distance); the noise of a plain floor follows the guess (more than 0.38).
_APART: Final = 0.0133
_MAX_DEPENDENCE: Final = 0.2  # largest difference of the motions, relative to the guesses'
_MIN_SPREAD_M: Final = 0.3  # points closer together give no motion: turn and shift look alike
_ROUNDS: Final = 6  # of fitting and reweighting
# Largest relative error between the two heights, corrected if a ground mask is given. With points
# on boxes, a scale would absorb their motion.
_MAX_SCALE: Final = 0.02
# A motion that differs from telemetry by more than these was not measured on the ground.
MAX_YAW_RAD: Final = 0.1
_MAX_SHIFT_M: Final = 0.12


class GroundView(NamedTuple):
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
    first: GroundView, second: GroundView, guess: Pose2D, ground: Image | None = None
) -> GroundMotion | None:
    """Measure the pose of the second camera in the level frame of the first.

    None with too few points on the ground, and on ground without texture. The search starts with a
    guess. `ground`, (H, W), is not zero where the first frame shows ground, if that is known.
    """
    quality = _QUALITY if ground is None else _QUALITY_IN_MASK
    corners = cv2.goodFeaturesToTrack(first.grey, _POINTS, quality, _SPACING_PX, mask=ground)
    if corners is None or len(corners) < _MIN_POINTS:
        return None
    corners = corners.reshape(-1, 2)
    here = ground_points(corners, first.camera, first.gimbal_pitch_rad, first.height_m)
    near = np.hypot(*here.T) < TRACKED_RANGE_M
    points = corners[near].astype(np.float32), here[near]
    if ground is None:
        return _tracked(points, first, second, guess)
    apart_m = _APART * second.height_m
    low, high = (_tracked(points, first, second, guess, off) for off in (-apart_m, apart_m))
    if low is None or high is None:
        return None
    x_m, y_m = high.motion.x_m - low.motion.x_m, high.motion.y_m - low.motion.y_m
    if math.hypot(x_m, y_m) > _MAX_DEPENDENCE * 2.0 * math.sqrt(2.0) * apart_m:
        return None
    return GroundMotion(low.motion.towards(high.motion, 0.5), min(low.spread_m, high.spread_m))


def _tracked(
    points: tuple[Floats32, Floats],
    first: GroundView,
    second: GroundView,
    guess: Pose2D,
    shift_m: float | None = None,
) -> GroundMotion | None:
    """Track points and fit their motion by iterative reweighting, which rejects other points.

    Points are (N, 2) pixels in the first frame, and their places on the ground, m. They are tracked
    from the guess, shifted ahead and to the right (None without a ground mask).
    """
    begin, here = points
    off_m = shift_m or 0.0
    start = replace(guess, x_m=guess.x_m + off_m, y_m=guess.y_m + off_m)
    level = np.column_stack([_moved(here, start), np.full(len(here), second.height_m)])
    expected = project(level, second.camera, second.gimbal_pitch_rad)
    usable = np.isfinite(expected).all(axis=1)
    if np.count_nonzero(usable) < _MIN_POINTS:
        return None
    found, status, _ = cv2.calcOpticalFlowPyrLK(
        first.grey,
        second.grey,
        begin[usable],
        expected[usable].astype(np.float32),
        winSize=(_WINDOW_PX, _WINDOW_PX),
        maxLevel=2,
        flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
    )
    there = ground_points(found, second.camera, second.gimbal_pitch_rad, second.height_m)
    good = (status.ravel() == 1) & np.isfinite(there).all(axis=1)
    here, there = here[usable][good], there[good]
    if len(here) < _MIN_POINTS:
        return None
    # The guess may have a common error: remove the median shift before weighting points.
    residual_m = there - _moved(here, guess)
    residual_m -= np.median(residual_m, axis=0)
    max_scale, share = (0.0, 0.0) if shift_m is None else (_MAX_SCALE, _MIN_SHARE)
    x_m, y_m, yaw_rad, spread_m, inliers = _reweighted(here, there, residual_m, max_scale)
    motion = Pose2D(x_m=x_m, y_m=y_m, yaw_rad=yaw_rad)
    enough = inliers >= max(_MIN_POINTS, share * len(here)) and spread_m >= _MIN_SPREAD_M
    shifted_m = math.hypot(x_m - guess.x_m, y_m - guess.y_m)
    near = shifted_m <= _MAX_SHIFT_M and abs(yaw_rad - guess.yaw_rad) <= MAX_YAW_RAD
    return GroundMotion(motion, spread_m) if enough and near else None


def _moved(points: Floats, motion: Pose2D) -> Floats:
    return rotate_points(points, -motion.yaw_rad) + motion.to_body(0.0, 0.0)


@compiled(
    "Tuple((float64, float64, float64, float64, int64))"
    "(float64[:, ::1], float64[:, ::1], float64[:, ::1], float64)"
)
def _reweighted(
    here: Floats, there: Floats, residual_m: Floats, max_scale: float
) -> tuple[float, float, float, float, int]:
    """Fit a motion of the plane by rounds of weighted least squares (Umeyama, in the plane).

    The scale absorbs the error of the second height relative to the first, which would otherwise
    appear as forward motion. OpenCV's `estimateAffinePartial2D` has no weights, and SciPy's
    `Rotation.align_vectors` works in three dimensions without the translation.

    Points are (N, 2) m, in the level frames of both cameras; the differences by which they are
    first weighted are overwritten. Returned are the pose of the second camera, spread, inliers.
    """
    x_m, y_m, yaw_rad, spread_m2 = 0.0, 0.0, 0.0, 0.0
    weights = np.empty(len(here))
    scale_m = 4.0 * _INLIER_M
    for _ in range(_ROUNDS):
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
            # Points turn opposite to the camera, and y is to the right.
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
        scale_m = max(_INLIER_M, 0.6 * scale_m)
    inliers = 0
    for point in range(len(here)):
        inliers += math.hypot(residual_m[point, 0], residual_m[point, 1]) < _INLIER_M
    return x_m, y_m, yaw_rad, math.sqrt(spread_m2), inliers
