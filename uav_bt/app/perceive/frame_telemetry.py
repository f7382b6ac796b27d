"""Telemetry of a video's frames: height, gimbal pitch and motion at each frame.

A live flight's frames come with their telemetry. A video file's do not: either the camera was
fixed at a known height and pitch, or the record of the same flight holds the telemetry.
"""

from __future__ import annotations

import math
from typing import Final, Protocol

import numpy as np
from numpy.typing import NDArray

from uav_bt.errors import FileError
from uav_bt.record.channels import FrameNote
from uav_bt.record.footage import footage
from uav_bt.record.moment import StoredFrame
from uav_bt.record.reader import RecordReader
from uav_bt.types import Attitude, DroneState, Frame

_SLACK_S: Final = 0.25  # a frame this long before the first or after the last entry still has one


class Telemetry(Protocol):
    """Finds the poses of frames; times are of the video, which begins at 0."""

    def frame(self, image: NDArray[np.uint8], index: int, time_s: float) -> Frame:
        """Return an image, (H, W, 3) RGB, as a frame; unknown heights are NaN."""
        ...

    def states(self, until_s: float) -> list[DroneState]:
        """Return the drone's states since the last call, up to a time; none of a fixed camera."""
        ...


class FixedTelemetry:
    """A camera that always looks down from the same height, as on a tripod.

    Args:
        height_m: above the ground.
        gimbal_pitch_rad: 0 level, negative down.
    """

    def __init__(self, *, height_m: float, gimbal_pitch_rad: float) -> None:
        self._height_m = height_m
        self._pitch_rad = gimbal_pitch_rad

    def frame(self, image: NDArray[np.uint8], index: int, time_s: float) -> Frame:
        """Return an image as a frame."""
        return Frame(
            image=image,
            index=index,
            captured_s=time_s,
            gimbal_pitch_rad=self._pitch_rad,
            altitude_m=self._height_m,
            height_m=self._height_m,
            height_above_ground_m=self._height_m,
        )

    def states(self, until_s: float) -> list[DroneState]:
        """Return nothing: the camera's movement is unknown."""
        del until_s
        return []


class FlightTelemetry:
    """A flight's own telemetry, interpolated between the frames of its record.

    Args:
        reader: of the record.

    Raises:
        FileError: the record is damaged or has no frame.
    """

    def __init__(self, reader: RecordReader) -> None:
        notes: list[FrameNote] = []
        states: list[DroneState] = []
        for item in footage(reader):
            if isinstance(item, StoredFrame):
                notes.append(item.note)
            elif isinstance(item, DroneState):
                states.append(item)
        if not notes:
            raise FileError(reader.path, "the record has no frame with an image")
        self._begin_s = notes[0].captured_s
        self._states = [state.dated(state.captured_s - self._begin_s) for state in states]
        self._next_state = 0
        columns = np.array(
            [
                (
                    *(note.captured_s - self._begin_s, note.gimbal_pitch_rad),
                    *(note.altitude_m, note.height_m, note.height_above_ground_m),
                    *(note.attitude.roll_rad, note.attitude.pitch_rad, note.attitude.yaw_rad),
                )
                for note in notes
            ]
        )
        columns[:, -3:] = np.unwrap(columns[:, -3:], axis=0)
        self.times_s: NDArray[np.float64] = columns[:, 0]  # (N,) of the frames, from the first one
        self._columns = columns[:, 1:].T

    def frame(self, image: NDArray[np.uint8], index: int, time_s: float) -> Frame:
        """Return an image as a frame; its heights are NaN beyond the flight's ends."""
        times = self.times_s
        if times[0] - _SLACK_S <= time_s <= times[-1] + _SLACK_S:
            values = [float(np.interp(time_s, times, column)) for column in self._columns]
        else:
            values = [math.nan] * len(self._columns)
        gimbal, altitude_m, height_m, above_ground_m, roll, pitch, yaw = values
        return Frame(
            image=image,
            index=index,
            captured_s=time_s,
            gimbal_pitch_rad=gimbal,
            attitude=Attitude(roll_rad=roll, pitch_rad=pitch, yaw_rad=yaw),
            altitude_m=altitude_m,
            height_m=height_m,
            height_above_ground_m=above_ground_m,
        )

    def states(self, until_s: float) -> list[DroneState]:
        """Return the states since the last call, up to a time of the video."""
        begin = end = self._next_state
        # With a tolerance: the video's times are differences.
        while end < len(self._states) and self._states[end].captured_s <= until_s + 1e-9:
            end += 1
        self._next_state = end
        return self._states[begin:end]
