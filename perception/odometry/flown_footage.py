"""Footage of a flight, gathered frame by frame and state by state."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from perception.odometry.camera_track import FOOTAGE_SIZE_PX, Footage, shrink
from uav_bt.errors import ShapeError
from uav_bt.types import Attitude, CameraModel, DroneState, Frame


class FootageBuilder:
    """Gathers frames and telemetry in the order of time.

    Args:
        camera: the flight's camera, at any size; without distortion.
    """

    def __init__(self, camera: CameraModel) -> None:
        self._camera = camera.resized(*FOOTAGE_SIZE_PX)
        self._images: list[NDArray[np.uint8]] = []
        self._frames: list[tuple[int, float, float, float, float, float]] = []
        self._attitudes: list[tuple[float, float, float]] = []
        self._states: list[DroneState] = []

    def __len__(self) -> int:
        return len(self._images)

    def add_frame(self, frame: Frame) -> bool:
        """Keep a frame unless it was kept before or its telemetry is not finite.

        Args:
            frame: no older than the frames before.

        Returns:
            Whether it was kept.
        """
        numbers = (
            frame.captured_s,
            frame.gimbal_pitch_rad,
            frame.altitude_m,
            frame.height_m,
            frame.height_above_ground_m,
        )
        angles = _angles(frame.attitude)
        newer = not self._frames or (
            frame.index > self._frames[-1][0] and frame.captured_s > self._frames[-1][1]
        )
        if not newer or not all(map(math.isfinite, (*numbers, *angles))):
            return False
        self._images.append(shrink(frame.image))
        self._frames.append((frame.index, *numbers))
        self._attitudes.append(angles)
        return True

    def add_state(self, state: DroneState) -> None:
        """Keep telemetry whose velocity is newer than the last one kept."""
        speeds = (state.velocity.forward_mps, state.velocity.right_mps, state.velocity.down_mps)
        times = (state.times.velocity_s, state.times.attitude_s)
        if not all(map(math.isfinite, (*speeds, *times, *_angles(state.attitude)))):
            return
        if not self._states or state.times.velocity_s > self._states[-1].times.velocity_s:
            self._states.append(state)

    def footage(self) -> Footage:
        """Return the gathered footage.

        Raises:
            ShapeError: there is no frame or no telemetry.
        """
        if not self._images or not self._states:
            raise ShapeError(
                "frames and states of a flight",
                expected="at least 1 of each",
                actual=(len(self._images), len(self._states)),
            )
        index, captured_s, pitch_rad, altitude_m, height_m, above_ground_m = zip(
            *self._frames, strict=True
        )
        return Footage(
            frames=np.stack(self._images),
            index=np.array(index, dtype=np.int64),
            captured_s=np.array(captured_s),
            gimbal_pitch_rad=np.array(pitch_rad),
            attitude_rad=np.array(self._attitudes),
            altitude_m=np.array(altitude_m),
            height_m=np.array(height_m),
            height_above_ground_m=np.array(above_ground_m),
            state_s=np.array([state.times.velocity_s for state in self._states]),
            state_attitude_rad=_attitudes_at_velocities(self._states),
            velocity_mps=np.array(
                [
                    (state.velocity.forward_mps, state.velocity.right_mps, state.velocity.down_mps)
                    for state in self._states
                ]
            ),
            camera=self._camera,
        )


def _attitudes_at_velocities(states: list[DroneState]) -> NDArray[np.float64]:
    """Return roll, pitch and yaw at the times of the velocities, interpolated, (N, 3) rad."""
    angles = np.unwrap([_angles(state.attitude) for state in states], axis=0)
    measured_s = [state.times.attitude_s for state in states]
    velocity_s = [state.times.velocity_s for state in states]
    return np.stack([np.interp(velocity_s, measured_s, column) for column in angles.T], axis=1)


def _angles(attitude: Attitude) -> tuple[float, float, float]:
    return attitude.roll_rad, attitude.pitch_rad, attitude.yaw_rad
