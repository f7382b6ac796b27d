"""Where a picture was taken from: what a frame needs to know beside its pixels.

A live flight's frames come with their telemetry. A video file's do not: either the camera stood
still at a known height and pitch, or the flight's footage file tells.
"""

from __future__ import annotations

import math
from typing import Final, Protocol

import numpy as np
from numpy.typing import NDArray

from perception.footage.file import Footage
from uav_bt.errors import ValueRangeError
from uav_bt.types import Attitude, BodyVelocity, DroneState, FlyingState, Frame

__all__ = ["FixedTelemetry", "FootageTelemetry", "Telemetry"]

_SLACK_S: Final = 0.25  # a picture this long before the first or after the last entry still has one


class Telemetry(Protocol):
    """Knows where pictures were taken from; times are of the video, which begins at 0."""

    def frame(self, image: NDArray[np.uint8], index: int, time_s: float) -> Frame:
        """Return a picture, (H, W, 3) RGB, as a frame; heights are NaN where nobody knows them."""
        ...

    def states(self, until_s: float) -> list[DroneState]:
        """Return the drone's states since the last call, up to a time; none where it stands."""
        ...


class FixedTelemetry:
    """A camera that always looks down from the same height, as on a tripod."""

    def __init__(self, *, height_m: float, gimbal_pitch_rad: float) -> None:
        """Take the pose.

        Args:
            height_m: above the carpet.
            gimbal_pitch_rad: 0 level, negative down.

        Raises:
            ValueRangeError: the height is not positive, or the pitch not within a right angle.
        """
        if not (math.isfinite(height_m) and height_m > 0.0):
            raise ValueRangeError(f"the camera must be above the carpet, got {height_m} m")
        if not abs(gimbal_pitch_rad) <= math.pi / 2 + 1e-9:
            raise ValueRangeError(
                f"gimbal pitch must lie within -pi/2 and pi/2 rad, got {gimbal_pitch_rad}"
            )
        self._height_m = height_m
        self._pitch_rad = gimbal_pitch_rad

    def frame(self, image: NDArray[np.uint8], index: int, time_s: float) -> Frame:
        """Return a picture as a frame."""
        return Frame(
            image=image,
            index=index,
            captured_s=time_s,
            gimbal_pitch_rad=self._pitch_rad,
            altitude_m=self._height_m,
            height_m=self._height_m,
            height_above_carpet_m=self._height_m,
        )

    def states(self, until_s: float) -> list[DroneState]:
        """Return nothing: how such a camera moves nobody knows."""
        del until_s
        return []


class FootageTelemetry:
    """A flight's own telemetry, interpolated between the entries of its footage file."""

    def __init__(self, footage: Footage) -> None:
        self._footage = footage
        self._begin_s = float(footage.captured_s[0])
        self._attitude = np.unwrap(footage.attitude_rad, axis=0)
        self._next_state = 0

    @property
    def times_s(self) -> NDArray[np.float64]:
        """When the footage's own frames were taken, (N,) seconds from the first one."""
        return np.asarray(self._footage.captured_s - self._begin_s)

    def frame(self, image: NDArray[np.uint8], index: int, time_s: float) -> Frame:
        """Return a picture as a frame; its heights are NaN beyond the flight's ends."""
        footage, flight_s = self._footage, time_s + self._begin_s
        roll, pitch, yaw = (self._at(column, flight_s) for column in self._attitude.T)
        return Frame(
            image=image,
            index=index,
            captured_s=time_s,
            gimbal_pitch_rad=self._at(footage.gimbal_pitch_rad, flight_s),
            attitude=Attitude(roll_rad=roll, pitch_rad=pitch, yaw_rad=yaw),
            altitude_m=self._at(footage.altitude_m, flight_s),
            height_m=self._at(footage.height_m, flight_s),
            height_above_carpet_m=self._at(footage.height_above_carpet_m, flight_s),
        )

    def _at(self, values: NDArray[np.float64], flight_s: float) -> float:
        times = self._footage.captured_s
        if not times[0] - _SLACK_S <= flight_s <= times[-1] + _SLACK_S:
            return math.nan
        return float(np.interp(flight_s, times, values))

    def states(self, until_s: float) -> list[DroneState]:
        """Return the states since the last call, up to a time of the video."""
        footage, begin = self._footage, self._next_state
        # A hair of tolerance: the video's times are differences.
        end = int(np.searchsorted(footage.state_s, until_s + self._begin_s + 1e-9, side="right"))
        self._next_state = max(begin, end)
        return [self._state(entry) for entry in range(begin, self._next_state)]

    def _state(self, entry: int) -> DroneState:
        footage = self._footage
        roll, pitch, yaw = (float(angle) for angle in footage.state_attitude_rad[entry])
        forward, right, down = (float(speed) for speed in footage.velocity_mps[entry])
        return DroneState(
            captured_s=float(footage.state_s[entry]) - self._begin_s,
            flying=FlyingState.FLYING,
            attitude=Attitude(roll_rad=roll, pitch_rad=pitch, yaw_rad=yaw),
            velocity=BodyVelocity(forward_mps=forward, right_mps=right, down_mps=down),
        )
