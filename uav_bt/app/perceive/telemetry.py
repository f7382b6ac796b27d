"""Telemetry of a video's frames: height, gimbal pitch and motion at each frame.

A live flight's frames come with their telemetry. A video file's do not: either the camera was
fixed at a known height and pitch, or the record of the same flight holds the telemetry.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from uav_bt.errors import FileError
from uav_bt.record.channels import FrameNote
from uav_bt.record.moment import StoredFrame
from uav_bt.record.reader import RecordReader, footage
from uav_bt.types import Attitude, DroneState, Frame


class Telemetry:
    """Poses of frames, interpolated; times are of the video, which begins at 0."""

    def __init__(
        self, notes: Sequence[FrameNote], states: Sequence[DroneState], slack_s: float
    ) -> None:
        begin_s = notes[0].captured_s
        self._states = [state.dated(state.captured_s - begin_s) for state in states]
        self._next_state = 0
        self._slack_s = slack_s
        columns = np.array(
            [
                (
                    *(note.captured_s - begin_s, note.gimbal_pitch_rad),
                    *(note.altitude_m, note.height_m, note.height_above_ground_m),
                    *(note.attitude.roll_rad, note.attitude.pitch_rad, note.attitude.yaw_rad),
                )
                for note in notes
            ]
        )
        columns[:, -3:] = np.unwrap(columns[:, -3:], axis=0)
        self.times_s: NDArray[np.float64] = columns[:, 0]  # (N,) of the notes, from the first one
        self._columns = columns[:, 1:].T

    @classmethod
    def fixed(cls, height_m: float, gimbal_pitch_rad: float) -> Telemetry:
        """Return that of a camera that always looks down from the same height above the ground."""
        note = FrameNote(
            index=0,
            captured_s=0.0,
            gimbal_pitch_rad=gimbal_pitch_rad,
            altitude_m=height_m,
            height_m=height_m,
            height_above_ground_m=height_m,
        )
        return cls([note], [], math.inf)

    @classmethod
    def of_flight(cls, reader: RecordReader) -> Telemetry:
        """Return that of a record; FileError if it is damaged or has no frame."""
        notes: list[FrameNote] = []
        states: list[DroneState] = []
        for item in footage(reader):
            if isinstance(item, StoredFrame):
                notes.append(item.note)
            elif isinstance(item, DroneState):
                states.append(item)
        if not notes:
            raise FileError(reader.path, "the record has no frame with an image")
        return cls(notes, states, 0.25)

    def frame(self, image: NDArray[np.uint8], index: int, time_s: float) -> Frame:
        """Return an image, (H, W, 3) RGB, as a frame; heights beyond the flight's ends are NaN."""
        times = self.times_s
        if times[0] - self._slack_s <= time_s <= times[-1] + self._slack_s:
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
        """Return the drone's states since the last call, up to a time of the video."""
        begin = end = self._next_state
        # With a tolerance: the video's times are differences.
        while end < len(self._states) and self._states[end].captured_s <= until_s + 1e-9:
            end += 1
        self._next_state = end
        return self._states[begin:end]
