"""A flight's footage, and the camera's motion between its frames from telemetry.

The gimbal's pitch and the heading give the camera's rotation, the integrated velocity its
translation. No ground truth is needed, and unlike the output of a pose network the motion is in
metres. The images of the ground make it precise (`perception.odometry.visual`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from perception.odometry.visual import GroundView, OdometryConfig, ground_motion
from uav_bt.errors import ShapeError, ValueRangeError
from uav_bt.types import CameraModel, Pose2D
from uav_bt.types.arrays import Floats
from uav_bt.types.projection import camera_axes

FOOTAGE_SIZE_PX: Final = (320, 256)  # width, height: SC-Depth's size for indoor video


@dataclass(frozen=True, kw_only=True, eq=False)
class Footage:
    """One flight's video and telemetry; all times are of the flight's clock."""

    frames: NDArray[np.uint8]  # (N, H, W, 3) RGB, resized, never cropped
    index: NDArray[np.int64]  # (N,), the drone's frame numbers, increasing
    captured_s: Floats  # (N,), increasing
    gimbal_pitch_rad: Floats  # (N,), relative to the horizon
    attitude_rad: Floats  # (N, 3): roll, pitch, yaw (clockwise) at capture
    altitude_m: Floats  # (N,), above the take-off point
    height_m: Floats  # (N,), above the surface below
    height_above_ground_m: Floats  # (N,), of the body's centre
    # Telemetry of every tick. It arrives sooner than the frames and is matched to them by time.
    state_s: Floats  # (M,), increasing
    state_attitude_rad: Floats  # (M, 3)
    velocity_mps: Floats  # (M, 3): forward, right, down in the heading-aligned body frame
    camera: CameraModel  # at the frames' size

    def __post_init__(self) -> None:
        count, ticks = len(self.captured_s), len(self.state_s)
        if self.frames.ndim != 4 or self.frames.shape[3] != 3 or self.frames.dtype != np.uint8:
            raise ShapeError("footage frames", expected="NxHxWx3 uint8", actual=self.frames.shape)
        wanted = {
            "frames": (count, self.camera.height_px, self.camera.width_px, 3),
            "attitude_rad": (count, 3),
            "state_attitude_rad": (ticks, 3),
            "velocity_mps": (ticks, 3),
            **dict.fromkeys(_PER_FRAME, (count,)),
            "state_s": (ticks,),
        }
        for name, shape in wanted.items():
            array = getattr(self, name)
            if array.shape != shape:
                expected = "x".join(map(str, shape))
                raise ShapeError(f"footage {name}", expected=expected, actual=array.shape)
            if not np.isfinite(array).all():
                raise ValueRangeError(f"footage {name} holds NaN or infinity")
        for name in ("index", "captured_s", "state_s"):
            if (np.diff(getattr(self, name)) <= 0).any():
                raise ValueRangeError(f"footage {name} must rise from entry to entry")

    def __len__(self) -> int:
        return len(self.frames)


_PER_FRAME: Final = (
    *("index", "captured_s", "gimbal_pitch_rad", "altitude_m", "height_m"),
    "height_above_ground_m",
)


def shrink(
    image: NDArray[np.uint8], size_px: tuple[int, int] = FOOTAGE_SIZE_PX
) -> NDArray[np.uint8]:
    """Resize an image, (H, W, 3), by area to a width and height; it is never cropped."""
    if image.shape[1::-1] == size_px:
        return image
    return np.asarray(cv2.resize(image, size_px, interpolation=cv2.INTER_AREA), dtype=np.uint8)


@dataclass(frozen=True, kw_only=True)
class TrackConfig:
    """How telemetry is smoothed."""

    # Width of the local parabola over headings. Their noise is about a third of a degree, more than
    # a pixel. This width removes most of the noise and keeps turns.
    yaw_window_s: float = 0.15
    height_window_s: float = 0.4  # of the height's parabola; shorter than a climb and a descent

    def __post_init__(self) -> None:
        if not min(self.yaw_window_s, self.height_window_s) > 0.0:
            raise ValueRangeError(
                "yaw_window_s and height_window_s must be positive, got "
                f"{self.yaw_window_s} and {self.height_window_s}"
            )


@dataclass(frozen=True, kw_only=True, eq=False)
class CameraTrack:
    """Pose of the camera at each frame.

    The frame of reference has its origin at the drone's first position, x along heading zero, y to
    its right, z down.
    """

    rotation: Floats  # (N, 3, 3), from the camera frame (x right, y down, z forward)
    position_m: Floats  # (N, 3), of the lens
    yaw_rad: Floats  # (N,), smoothed, unwrapped, clockwise
    height_m: Floats  # (N,), of the lens above the ground, smoothed

    def motion(self, origin: int, target: int) -> Floats:
        """Return the transform of points between the cameras of two frames, (3, 4), metres."""
        turn = self.rotation[target].T
        rotation = turn @ self.rotation[origin]
        translation = turn @ (self.position_m[origin] - self.position_m[target])
        return np.concatenate([rotation, translation[:, None]], axis=1)


def camera_track(footage: Footage, config: TrackConfig | None = None) -> CameraTrack:
    """Return the camera's track through a flight, from telemetry.

    Args:
        footage: one flight.
        config: how telemetry is smoothed.
    """
    config = config or TrackConfig()
    times = np.concatenate([footage.captured_s, footage.state_s])
    headings = np.concatenate([footage.attitude_rad[:, 2], footage.state_attitude_rad[:, 2]])
    order = np.argsort(times, kind="stable")
    times, headings = times[order], np.unwrap(headings[order])
    yaw_rad = _local_parabola(times, headings, footage.captured_s, config.yaw_window_s)
    state_yaw_rad = _local_parabola(times, headings, footage.state_s, config.yaw_window_s)

    flown_m = _integrated(footage.state_s, _about_down(state_yaw_rad).apply(footage.velocity_mps))
    centre_m = np.stack(
        [np.interp(footage.captured_s, footage.state_s, flown_m[:, axis]) for axis in range(3)],
        axis=1,
    )
    # The lens is ahead of the body's centre and goes up and down with its nose.
    pitch_rad = footage.attitude_rad[:, 1]
    ahead_m = footage.camera.forward_offset_m
    lever = np.stack(
        [ahead_m * np.cos(pitch_rad), np.zeros_like(pitch_rad), -ahead_m * np.sin(pitch_rad)],
        axis=1,
    )
    level = np.stack([camera_axes(float(pitch)) for pitch in footage.gimbal_pitch_rad])
    return CameraTrack(
        rotation=_about_down(yaw_rad).as_matrix() @ level,
        position_m=centre_m + _about_down(yaw_rad).apply(lever),
        yaw_rad=yaw_rad,
        height_m=-lever[:, 2]
        + _local_parabola(
            footage.captured_s,
            footage.height_above_ground_m,
            footage.captured_s,
            config.height_window_s,
        ),
    )


def measured_motion(
    footage: Footage,
    track: CameraTrack,
    origin: int,
    target: int,
    config: OdometryConfig | None = None,
) -> Floats | None:
    """Return the transform of points between the cameras of two frames, measured on the ground.

    Args:
        footage: one flight.
        track: its camera track from telemetry.
        origin: index of the first frame in the footage.
        target: index of the second frame.
        config: how points are tracked.

    Returns:
        (3, 4), metres; None if the images do not show enough ground.
    """
    apart = _about_down(-track.yaw_rad[origin]).apply(
        track.position_m[target] - track.position_m[origin]
    )
    guess = Pose2D(
        x_m=float(apart[0]),
        y_m=float(apart[1]),
        yaw_rad=float(track.yaw_rad[target] - track.yaw_rad[origin]),
    )
    # The mean height and telemetry's climb, because the noise of two heights would bias the result.
    middle_m = 0.5 * float(track.height_m[origin] + track.height_m[target])
    climb_m = -float(apart[2])
    first, second = (
        GroundView(
            grey=np.asarray(cv2.cvtColor(footage.frames[place], cv2.COLOR_RGB2GRAY), np.uint8),
            camera=footage.camera,
            gimbal_pitch_rad=float(footage.gimbal_pitch_rad[place]),
            height_m=middle_m + share * climb_m,
        )
        for place, share in ((origin, -0.5), (target, 0.5))
    )
    if min(first.height_m, second.height_m) <= 0.0:
        return None
    shown = ground_motion(first, second, guess, config=config)
    if shown is None:
        return None
    found = shown.motion
    back = _about_down(-found.yaw_rad).as_matrix()
    axes = [camera_axes(view.gimbal_pitch_rad) for view in (first, second)]
    moved = np.array([found.x_m, found.y_m, apart[2]])
    rotation = axes[1].T @ back @ axes[0]
    translation = -axes[1].T @ back @ moved
    return np.concatenate([rotation, translation[:, None]], axis=1)


def _about_down(yaw_rad: float | Floats) -> Rotation:
    """Return the rotation of each angle about the downward axis, clockwise seen from above."""
    return Rotation.from_rotvec(np.multiply.outer(yaw_rad, (0.0, 0.0, 1.0)))


def _integrated(times_s: Floats, rates: Floats) -> Floats:
    steps = 0.5 * (rates[1:] + rates[:-1]) * np.diff(times_s)[:, None]
    return np.concatenate([np.zeros((1, rates.shape[1])), np.cumsum(steps, axis=0)])


def _local_parabola(times: Floats, values: Floats, at: Floats, window_s: float) -> Floats:
    """Return a Gaussian-weighted quadratic fit of noisy samples at some times (Savitzky-Golay)."""
    result = np.empty_like(at)
    first = np.searchsorted(times, at - 3.0 * window_s)
    last = np.searchsorted(times, at + 3.0 * window_s)
    for place, moment in enumerate(at):
        near = slice(first[place], last[place])
        since = (times[near] - moment) / window_s
        weight = np.exp(-0.5 * since**2)
        # A little damping, because a flight's ends have few neighbours.
        basis = np.stack([np.ones_like(since), since, since**2], axis=1)
        normal = basis.T @ (weight[:, None] * basis) + 1e-6 * np.eye(3)
        result[place] = np.linalg.solve(normal, basis.T @ (weight * values[near]))[0]
    return result
