"""A flight's footage, and the camera's motion between its frames.

The gimbal's pitch and the heading give the camera's rotation, the integrated velocity its
translation. No ground truth is needed, and unlike the output of a pose network the motion is in
metres. The images of the ground make it precise (`perception.odometry.visual`).
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import astuple, dataclass
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from perception.odometry.visual import GroundView, ground_motion
from uav_bt.types import Attitude, CameraModel, DroneState, FlyingState, Frame, Pose2D
from uav_bt.types.arrays import Flags, Floats, Image, Indices
from uav_bt.types.projection import camera_axes

FOOTAGE_SIZE_PX: Final = (320, 256)  # width, height: SC-Depth's size for indoor video
LABEL_SIZE_PX: Final = (FOOTAGE_SIZE_PX[0] // 2, FOOTAGE_SIZE_PX[1] // 2)  # the network's output
EVERY: Final = 3  # every third frame is labelled: neighbours look alike, and dense flow is slow
_MIN_HEIGHT_M: Final = 0.8  # above the ground; frames before take-off are left out
_MIN_MOVE_M: Final = 0.04  # between two frames; less shows no depth
_MAX_APART_S: Final = 2.0  # between two frames; integrated velocity drifts
# Width of the local parabola over headings. Their noise is about a third of a degree, more than a
# pixel. This width removes most of the noise and keeps turns.
_YAW_WINDOW_S: Final = 0.15
_HEIGHT_WINDOW_S: Final = 0.4  # of the height's parabola; shorter than a climb and a descent


@dataclass(frozen=True, kw_only=True, eq=False)
class Flight:
    """One flight's N frames, telemetry and labels; all times are of the flight's clock."""

    frames: tuple[Frame, ...]  # in the order of time; resized, never cropped
    states: tuple[DroneState, ...]  # velocity, and the attitude at its time
    camera: CameraModel  # at the frames' size
    # (N, 2, h, w), metres along the optical axis: depth, NaN where unknown, and an upper bound, inf
    # without one.
    labels: NDArray[np.float16] | None = None


def shrink(image: Image, size_px: tuple[int, int] = FOOTAGE_SIZE_PX) -> Image:
    """Resize an image, (H, W, 3), by area to a width and height; it is never cropped."""
    if image.shape[1::-1] == size_px:
        return image
    return np.asarray(cv2.resize(image, size_px, interpolation=cv2.INTER_AREA), dtype=np.uint8)


def grey(frame: Frame) -> Image:
    """Return a frame's image in grey, (H, W)."""
    return np.asarray(cv2.cvtColor(frame.image, cv2.COLOR_RGB2GRAY), np.uint8)


def gathered(
    frames: Iterable[Frame], states: Iterable[DroneState], camera: CameraModel
) -> Flight | None:
    """Return a flight of shrunk frames and telemetry; None without one of them.

    Telemetry that is not finite is left out with its frame, and velocities that are not new.
    """
    shown = []
    for frame in frames:
        values = (frame.captured_s, frame.gimbal_pitch_rad, frame.height_above_ground_m)
        if _finite(*values, *astuple(frame.attitude)):
            shown.append(frame)
    told: list[DroneState] = []
    for state in states:
        velocity_s, newest_s = state.times.velocity_s, told[-1].times.velocity_s if told else -1e9
        values = (state.times.attitude_s, *astuple(state.velocity), *astuple(state.attitude))
        if _finite(velocity_s, *values) and velocity_s > newest_s:
            told.append(state)
    if not shown or not told:
        return None
    state_s = [state.times.velocity_s for state in told]
    attitude_s = [state.times.attitude_s for state in told]
    turned = np.unwrap([astuple(state.attitude) for state in told], axis=0).T
    aligned = zip(*(np.interp(state_s, attitude_s, angles) for angles in turned), strict=True)
    return Flight(
        frames=tuple(shown),
        states=tuple(
            DroneState(
                captured_s=state.times.velocity_s,
                flying=FlyingState.FLYING,
                attitude=Attitude(roll_rad=float(roll), pitch_rad=float(pitch), yaw_rad=float(yaw)),
                velocity=state.velocity,
            )
            for state, (roll, pitch, yaw) in zip(told, aligned, strict=True)
        ),
        camera=camera.resized(*FOOTAGE_SIZE_PX),
    )


def _finite(*values: float) -> bool:
    return all(map(math.isfinite, values))


class CameraTrack:
    """Poses of the camera at a flight's frames, with x along heading 0, z down."""

    def __init__(self, flight: Flight) -> None:
        self._flight, frames, states = flight, flight.frames, flight.states
        self._captured_s = captured_s = np.array([frame.captured_s for frame in frames])
        state_s = np.array([state.captured_s for state in states])
        times = np.concatenate([captured_s, state_s])
        attitudes = [frame.attitude for frame in frames] + [state.attitude for state in states]
        headings = np.array([attitude.yaw_rad for attitude in attitudes])
        order = np.argsort(times, kind="stable")
        times, headings = times[order], np.unwrap(headings[order])
        # (N,), smoothed, unwrapped, clockwise.
        self.yaw_rad = _local_parabola(times, headings, captured_s, _YAW_WINDOW_S)
        state_yaw_rad = _local_parabola(times, headings, state_s, _YAW_WINDOW_S)
        velocity_mps = np.array([astuple(state.velocity) for state in states])
        rates = _about_down(state_yaw_rad).apply(velocity_mps)
        steps_m = 0.5 * (rates[1:] + rates[:-1]) * np.diff(state_s)[:, None]
        flown_m = np.concatenate([np.zeros((1, 3)), np.cumsum(steps_m, axis=0)])
        centre_m = np.stack([np.interp(captured_s, state_s, line) for line in flown_m.T], axis=1)
        # The lens is ahead of the body's centre and goes up and down with its nose.
        pitch_rad = np.array([frame.attitude.pitch_rad for frame in frames])
        ahead_m, zero = flight.camera.forward_offset_m, np.zeros_like(pitch_rad)
        lever = np.stack([ahead_m * np.cos(pitch_rad), zero, -ahead_m * np.sin(pitch_rad)], axis=1)
        level = np.stack([camera_axes(frame.gimbal_pitch_rad) for frame in frames])
        turn = _about_down(self.yaw_rad)
        # (N, 3, 3), from the camera frame (x right, y down, z forward).
        self.rotation = turn.as_matrix() @ level
        self.position_m = centre_m + turn.apply(lever)  # (N, 3), of the lens
        heights_m = np.array([frame.height_above_ground_m for frame in frames])
        self.aloft: Flags = heights_m >= _MIN_HEIGHT_M  # (N,), whether a frame was taken in flight
        smooth_m = _local_parabola(captured_s, heights_m, captured_s, _HEIGHT_WINDOW_S)
        self._height_m = -lever[:, 2] + smooth_m  # of the lens above the ground

    def near(self, place: int, max_move_m: float, max_turn_rad: float) -> Indices:
        """Return the frames that show depth beside a frame: moved, but not too far or too long."""
        moved_m = np.linalg.norm(self.position_m - self.position_m[place], axis=1)
        # The angle between two optical axes: pitch and heading together.
        cosine = self.rotation[:, :, 2] @ self.rotation[place, :, 2]
        return np.flatnonzero(
            (moved_m >= _MIN_MOVE_M)
            & (moved_m <= max_move_m)
            & (cosine >= math.cos(max_turn_rad))
            & (np.abs(self._captured_s - self._captured_s[place]) <= _MAX_APART_S)
        )

    def motion(self, origin: int, target: int) -> Floats:
        """Return the transform of points between two frames' cameras by telemetry, (3, 4), m."""
        turn = self.rotation[target].T
        rotation = turn @ self.rotation[origin]
        translation = turn @ (self.position_m[origin] - self.position_m[target])
        return np.concatenate([rotation, translation[:, None]], axis=1)

    def measured_motion(self, origin: int, target: int) -> Floats | None:
        """Return `motion` measured on the ground; None if the images do not show enough of it."""
        away_m = self.position_m[target] - self.position_m[origin]
        apart = _about_down(-self.yaw_rad[origin]).apply(away_m)
        x_m, y_m, down_m = apart.tolist()
        yaw_rad = float(self.yaw_rad[target] - self.yaw_rad[origin])
        # The mean height and telemetry's climb: the noise of two heights would bias the result.
        middle_m = 0.5 * float(self._height_m[origin] + self._height_m[target])
        if middle_m <= 0.5 * abs(down_m):
            return None
        camera, frames = self._flight.camera, self._flight.frames
        first, second = (
            GroundView(grey(frame), camera, frame.gimbal_pitch_rad, middle_m + above_m)
            for frame, above_m in ((frames[origin], 0.5 * down_m), (frames[target], -0.5 * down_m))
        )
        shown = ground_motion(first, second, Pose2D(x_m=x_m, y_m=y_m, yaw_rad=yaw_rad))
        if shown is None:
            return None
        found = shown.motion
        back = _about_down(-found.yaw_rad).as_matrix()
        here, there = (camera_axes(view.gimbal_pitch_rad) for view in (first, second))
        translation = -there.T @ back @ np.array([found.x_m, found.y_m, down_m])
        return np.concatenate([there.T @ back @ here, translation[:, None]], axis=1)


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
