"""Ground-plane visual odometry: dead reckoning, corrected by what the camera sees of the carpet.

The drone's own velocity is off by a centimetre a second for seconds on end, which adds up to a
quarter of a metre in half a minute. The carpet stands still, and its points lie in a known plane:
two frames of them, followed by optical flow (Lucas and Kanade), give the horizontal movement, and
the heading to a fraction of the half degree by which telemetry's is wrong (which moves an image by
more than two pixels, more than depth does at some metres). `CarpetOdometry`, in flight, corrects
positions only: the error of telemetry's heading is bounded.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.odometry.height import SmoothHeight
from perception.odometry.velocity_error import VelocityError, VelocityErrorConfig
from uav_bt.classes import CARPET
from uav_bt.types import (
    BodyVelocity,
    CameraModel,
    ClassMap,
    DroneState,
    Frame,
    Pose2D,
    rotate,
    rotate_points,
    rotation,
)
from uav_bt.types.dead_reckoning import MotionEstimate, Odometry, OdometryPose
from uav_bt.types.projection import ground_points, project

Floats = NDArray[np.float64]
Image = NDArray[np.uint8]


@dataclass(frozen=True, kw_only=True)
class OdometryConfig:
    """How points are found, followed and trusted."""

    points: int = 150  # followed at most; more only cost time
    quality: float = 0.02  # of the strongest corner's; the carpet's texture is faint
    spacing_px: int = 5
    window_px: int = 15  # of the optical flow
    max_range_m: float = 4.0  # further carpet is seen too flatly to say much
    inlier_m: float = 0.03  # on the ground; boxes' points move by more
    min_points: int = 20  # with fewer, telemetry stays
    rounds: int = 6  # of fitting and weighing
    # What differs more from telemetry than it can be wrong was measured on something else.
    max_yaw_rad: float = 0.05
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


def ground_motion(
    first: GroundView,
    second: GroundView,
    guess: Pose2D,
    carpet: Image | None = None,
    config: OdometryConfig | None = None,
) -> Pose2D | None:
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
    return _fitted(here[good], there[good], guess, config)


def _moved(points: Floats, motion: Pose2D) -> Floats:
    return rotate_points(points, -motion.yaw_rad) + motion.to_body(0.0, 0.0)


def _fitted(here: Floats, there: Floats, guess: Pose2D, config: OdometryConfig) -> Pose2D | None:
    """Fit a rigid movement of the plane, reweighted so that what is no carpet loses its weight."""
    if len(here) < config.min_points:
        return None
    # Far points are measured worse: an error of a pixel grows with the square of the distance.
    trust = 1.0 / (1.0 + (there**2).sum(axis=1)) ** 2
    motion, scale_m = guess, 4.0 * config.inlier_m
    # The guess may be off as a whole: take the common shift away before points are judged.
    residual = there - _moved(here, motion)
    centre = np.median(residual, axis=0)
    weight = trust / (1.0 + (((residual - centre) / scale_m) ** 2).sum(axis=1)) ** 2
    for _ in range(config.rounds):
        motion = _rigid(here, there, weight)
        residual = there - _moved(here, motion)
        scale_m = max(config.inlier_m, 0.6 * scale_m)
        weight = trust / (1.0 + ((residual / scale_m) ** 2).sum(axis=1)) ** 2
    inliers = np.count_nonzero(np.hypot(*residual.T) < config.inlier_m)
    enough = inliers >= config.min_points and config.believes(motion, guess)
    return motion if enough else None


def _rigid(here: Floats, there: Floats, weight: Floats) -> Pose2D:
    """Return the weighted least-squares rotation and translation (Umeyama, in the plane).

    OpenCV's `estimateAffinePartial2D` has no weights and fits a scale, and SciPy's
    `Rotation.align_vectors` works in three dimensions without the translation.
    """
    share = weight / weight.sum()
    from_, to = share @ here, share @ there
    a, b = here - from_, there - to
    # Points turn counter to the camera, and y is to the right: the signs of a clockwise heading.
    yaw_rad = math.atan2(
        float(share @ (a[:, 1] * b[:, 0] - a[:, 0] * b[:, 1])),
        float(share @ (a[:, 0] * b[:, 0] + a[:, 1] * b[:, 1])),
    )
    origin = from_ - rotation(yaw_rad) @ to
    return Pose2D(x_m=float(origin[0]), y_m=float(origin[1]), yaw_rad=yaw_rad)


@dataclass(frozen=True, kw_only=True)
class CarpetOdometryConfig:
    """Which frames are compared."""

    width_px: int = 320  # of the images that points are followed in; a larger one only costs time
    max_gap_s: float = 0.5  # between two frames; telemetry alone after a longer one
    min_height_m: float = 0.5  # of the camera; lower the carpet rushes by
    following: OdometryConfig = field(default_factory=OdometryConfig)
    error: VelocityErrorConfig = field(default_factory=VelocityErrorConfig)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Sight:
    """A frame that the next is compared with."""

    view: GroundView
    carpet: NDArray[np.uint8]
    lens: OdometryPose  # by telemetry alone


class CarpetOdometry:
    """Integrates telemetry, and corrects it by every frame that shows enough carpet."""

    def __init__(self, config: CarpetOdometryConfig | None = None) -> None:
        self._config = config or CarpetOdometryConfig()
        self._odometry = Odometry()
        self._last: _Sight | None = None
        self._drift_m = np.zeros(2)  # to add to telemetry's positions when the last frame was seen
        self._seen_s = -math.inf  # capture of that frame
        self._tracked_s = -math.inf  # of the last frame whose ground was followed
        self._error = VelocityError(self._config.error)
        self._height = SmoothHeight()

    @property
    def now(self) -> OdometryPose | None:
        """The newest pose, None before the first telemetry."""
        return self._corrected(self._odometry.now)

    def at(self, time_s: float) -> OdometryPose | None:
        """Return the pose of a moment of the last seconds, None before the first telemetry."""
        return self._corrected(self._odometry.at(time_s))

    @property
    def estimate(self) -> MotionEstimate | None:
        """How the drone moves over the ground; None before the first frame and telemetry."""
        pose, seen = self.now, self.at(self._seen_s)
        if pose is None or seen is None or math.isinf(self._seen_s):
            return None
        told, error_mps = self._odometry.velocity, self._error.mps
        forward_mps, right_mps = rotate(error_mps[0], error_mps[1], -pose.yaw_rad)
        return MotionEstimate(
            pose=pose,
            seen=seen,
            velocity=BodyVelocity(
                forward_mps=told.forward_mps + forward_mps,
                right_mps=told.right_mps + right_mps,
                down_mps=told.down_mps,
            ),
            error=BodyVelocity(forward_mps=forward_mps, right_mps=right_mps),
            tracked_s=self._tracked_s,
        )

    def predict(self, state: DroneState) -> OdometryPose | None:
        """Follow the drone's own motion up to a telemetry sample; return the pose then."""
        self._odometry.update(state)
        self._height.predict(state)
        return self.now

    def see(self, class_map: ClassMap, frame: Frame, camera: CameraModel) -> None:
        """Correct the pose by what a frame shows of the carpet.

        Args:
            class_map: made from `frame`.
            frame: the newest; its telemetry says how the camera looked.
            camera: intrinsics at any size of the same shape.
        """
        before, self._last = self._last, self._sight(class_map, frame, camera)
        passed_s = max(0.0, frame.captured_s - self._seen_s)
        self._seen_s = frame.captured_s
        if math.isinf(passed_s):
            return
        self._error.predict(passed_s)
        shift_m = self._missed(before)
        if shift_m is None:
            self._drift_m += self._error.mps * passed_s  # what telemetry misses goes on
            return
        self._drift_m += shift_m
        self._tracked_s = frame.captured_s
        self._error.correct(shift_m / passed_s, passed_s)

    def _missed(self, before: _Sight | None) -> Floats | None:
        """Return by how much telemetry is wrong about the way from one frame to the last, (2,)."""
        if before is None or self._last is None:
            return None
        passed_s = self._last.lens.time_s - before.lens.time_s
        if not 0.0 < passed_s <= self._config.max_gap_s:
            return None
        reckoned = _between(before.lens, self._last.lens)
        error_m = rotate_points(self._error.mps * passed_s, -before.lens.yaw_rad)
        expected = replace(
            reckoned, x_m=reckoned.x_m + float(error_m[0]), y_m=reckoned.y_m + float(error_m[1])
        )
        measured = ground_motion(
            before.view, self._last.view, expected, before.carpet, self._config.following
        )
        if measured is None:
            return None
        missed_m = measured.x_m - reckoned.x_m, measured.y_m - reckoned.y_m
        return np.array(rotate(*missed_m, before.lens.yaw_rad))

    def _sight(self, class_map: ClassMap, frame: Frame, camera: CameraModel) -> _Sight | None:
        pose, height_m = self._odometry.at(frame.captured_s), self._height.see(frame)
        if pose is None or not height_m >= self._config.min_height_m:
            return None
        height_px, width_px = frame.image.shape[:2]
        small_px = min(width_px, self._config.width_px)
        size = (small_px, round(height_px * small_px / width_px))
        # Grey after shrinking: a quarter of the pixels to convert.
        small = cv2.resize(frame.image, size, interpolation=cv2.INTER_AREA)
        carpet = (class_map.ids == CARPET).astype(np.uint8)
        x_m, y_m = pose.to_world(camera.forward_offset_m, 0.0)
        return _Sight(
            view=GroundView(
                grey=np.asarray(cv2.cvtColor(small, cv2.COLOR_RGB2GRAY), dtype=np.uint8),
                camera=camera.resized(*size),
                gimbal_pitch_rad=frame.gimbal_pitch_rad,
                height_m=height_m,
            ),
            carpet=np.asarray(
                cv2.resize(carpet, size, interpolation=cv2.INTER_NEAREST_EXACT), dtype=np.uint8
            ),
            lens=replace(pose, x_m=x_m, y_m=y_m),
        )

    def _corrected(self, pose: OdometryPose | None) -> OdometryPose | None:
        if pose is None:
            return None
        since_s = 0.0 if math.isinf(self._seen_s) else pose.time_s - self._seen_s
        x_m, y_m = self._drift_m + self._error.mps * since_s
        return replace(pose, x_m=pose.x_m + float(x_m), y_m=pose.y_m + float(y_m))


def _between(first: Pose2D, second: Pose2D) -> Pose2D:
    """Return the second pose as seen from the first."""
    forward_m, right_m = first.to_body(second.x_m, second.y_m)
    turn_rad = math.remainder(second.yaw_rad - first.yaw_rad, 2.0 * math.pi)
    return Pose2D(x_m=forward_m, y_m=right_m, yaw_rad=turn_rad)
