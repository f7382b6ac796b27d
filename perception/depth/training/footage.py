"""A flight's footage, and the camera's motion between its frames.

The gimbal's pitch and the heading give the camera's rotation, the integrated velocity its
translation. No ground truth is needed, and unlike the output of a pose network the motion is in
metres. The images of the ground make it precise (`perception.odometry.visual`).
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from perception.odometry.visual import GroundView, ground_motion
from uav_bt.types import Attitude, CameraModel, DroneState, Frame, Pose2D
from uav_bt.types.arrays import Floats, Image
from uav_bt.types.projection import camera_axes

FOOTAGE_SIZE_PX: Final = (320, 256)  # width, height: SC-Depth's size for indoor video
# Width of the local parabola over headings. Their noise is about a third of a degree, more than a
# pixel. This width removes most of the noise and keeps turns.
_YAW_WINDOW_S: Final = 0.15
_HEIGHT_WINDOW_S: Final = 0.4  # of the height's parabola; shorter than a climb and a descent


@dataclass(frozen=True, kw_only=True, eq=False)
class Footage:
    """One flight's video and telemetry; all times are of the flight's clock."""

    frames: Image  # (N, H, W, 3) RGB, resized, never cropped
    index: NDArray[np.int64]  # (N,), the drone's frame numbers, increasing
    captured_s: Floats  # (N,), increasing
    gimbal_pitch_rad: Floats  # (N,), relative to the horizon
    attitude_rad: Floats  # (N, 3): roll, pitch, yaw (clockwise) at capture
    height_above_ground_m: Floats  # (N,), of the body's centre
    # Telemetry of every tick. It arrives sooner than the frames and is matched to them by time.
    state_s: Floats  # (M,), increasing
    state_attitude_rad: Floats  # (M, 3)
    velocity_mps: Floats  # (M, 3): forward, right, down in the heading-aligned body frame
    camera: CameraModel  # at the frames' size

    def __len__(self) -> int:
        return len(self.frames)


def shrink(image: Image, size_px: tuple[int, int] = FOOTAGE_SIZE_PX) -> Image:
    """Resize an image, (H, W, 3), by area to a width and height; it is never cropped."""
    if image.shape[1::-1] == size_px:
        return image
    return np.asarray(cv2.resize(image, size_px, interpolation=cv2.INTER_AREA), dtype=np.uint8)


def gathered(
    frames: Iterable[Frame], states: Iterable[DroneState], camera: CameraModel
) -> Footage | None:
    """Return the footage of a flight; None without a frame or without telemetry.

    Telemetry that is not finite is left out with its frame, and velocities that are not new.

    Args:
        frames: shrunk, in the order of time.
        states: in the order of time.
        camera: of the flight, at any size; without distortion.
    """
    images, rows = [], []
    for frame in frames:
        seen = (frame.captured_s, frame.gimbal_pitch_rad, frame.height_above_ground_m)
        row = (*seen, *_rad(frame.attitude))
        if all(map(math.isfinite, row)):
            images.append(frame)
            rows.append(row)
    told, newest_s = [], -math.inf  # times of velocity and attitude, velocity, angles
    for state in states:
        times, speeds = state.times, state.velocity
        velocity = (speeds.forward_mps, speeds.right_mps, speeds.down_mps)
        line = (times.velocity_s, times.attitude_s, *velocity, *_rad(state.attitude))
        if all(map(math.isfinite, line)) and times.velocity_s > newest_s:
            told.append(line)
            newest_s = times.velocity_s
    if not images or not told:
        return None
    shown, telemetry = np.array(rows), np.array(told)
    captured_s, pitch_rad, height_m = shown[:, :3].T.copy()
    state_s, attitude_s = telemetry[:, 0], telemetry[:, 1]
    turned = np.unwrap(telemetry[:, 5:], axis=0).T
    return Footage(
        frames=np.stack([frame.image for frame in images]),
        index=np.array([frame.index for frame in images], dtype=np.int64),
        captured_s=captured_s,
        gimbal_pitch_rad=pitch_rad,
        attitude_rad=shown[:, 3:].copy(),
        height_above_ground_m=height_m,
        state_s=state_s.copy(),
        # At the times of the velocities.
        state_attitude_rad=np.stack([np.interp(state_s, attitude_s, line) for line in turned], 1),
        velocity_mps=telemetry[:, 2:5].copy(),
        camera=camera.resized(*FOOTAGE_SIZE_PX),
    )


def _rad(attitude: Attitude) -> tuple[float, float, float]:
    return attitude.roll_rad, attitude.pitch_rad, attitude.yaw_rad


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


def camera_track(footage: Footage) -> CameraTrack:
    """Return the camera's track through a flight, from telemetry."""
    times = np.concatenate([footage.captured_s, footage.state_s])
    headings = np.concatenate([footage.attitude_rad[:, 2], footage.state_attitude_rad[:, 2]])
    order = np.argsort(times, kind="stable")
    times, headings = times[order], np.unwrap(headings[order])
    yaw_rad = _local_parabola(times, headings, footage.captured_s, _YAW_WINDOW_S)
    state_yaw_rad = _local_parabola(times, headings, footage.state_s, _YAW_WINDOW_S)

    rates = _about_down(state_yaw_rad).apply(footage.velocity_mps)
    steps_m = 0.5 * (rates[1:] + rates[:-1]) * np.diff(footage.state_s)[:, None]
    flown_m = np.concatenate([np.zeros((1, 3)), np.cumsum(steps_m, axis=0)])
    centre_m = np.stack(
        [np.interp(footage.captured_s, footage.state_s, line) for line in flown_m.T], axis=1
    )
    # The lens is ahead of the body's centre and goes up and down with its nose.
    pitch_rad, ahead_m = footage.attitude_rad[:, 1], footage.camera.forward_offset_m
    lever = np.stack(
        [ahead_m * np.cos(pitch_rad), np.zeros_like(pitch_rad), -ahead_m * np.sin(pitch_rad)],
        axis=1,
    )
    level = np.stack([camera_axes(float(pitch)) for pitch in footage.gimbal_pitch_rad])
    heights_m = _local_parabola(
        footage.captured_s, footage.height_above_ground_m, footage.captured_s, _HEIGHT_WINDOW_S
    )
    return CameraTrack(
        rotation=_about_down(yaw_rad).as_matrix() @ level,
        position_m=centre_m + _about_down(yaw_rad).apply(lever),
        yaw_rad=yaw_rad,
        height_m=-lever[:, 2] + heights_m,
    )


def measured_motion(
    footage: Footage, track: CameraTrack, origin: int, target: int
) -> Floats | None:
    """Return the transform of points between the cameras of two frames, measured on the ground.

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
    shown = ground_motion(first, second, guess)
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
