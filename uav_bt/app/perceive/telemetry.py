"""Telemetry of a video's frames: of a fixed camera, or of the flight's record."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from uav_bt.errors import FileError
from uav_bt.record.moment import StoredFrame
from uav_bt.record.reader import RecordReader, footage
from uav_bt.types import Attitude, DroneState, Frame
from uav_bt.types.camera import FrameNote

_SLACK_S: Final = 0.25  # by which an image may lie beyond the flight's ends
_NUMBERS: Final = ("gimbal_pitch_rad", "altitude_m", "height_m", "height_above_ground_m")
_ANGLES: Final = ("roll_rad", "pitch_rad", "yaw_rad")


class Telemetry:
    """Poses of frames, interpolated; times are of the video, which begins at 0."""

    def __init__(
        self, notes: Sequence[FrameNote], states: Sequence[DroneState], slack_s: float = _SLACK_S
    ) -> None:
        begin_s = notes[0].captured_s
        self._states = deque(state.dated(state.captured_s - begin_s) for state in states)
        self._slack_s = slack_s
        self.times_s = np.array([note.captured_s - begin_s for note in notes])  # from the first one
        self._numbers = {name: [getattr(note, name) for note in notes] for name in _NUMBERS}
        angles = {name: [getattr(note.attitude, name) for note in notes] for name in _ANGLES}
        self._angles = {name: np.unwrap(column) for name, column in angles.items()}

    @classmethod
    def fixed(cls, height_m: float, gimbal_pitch_rad: float) -> Telemetry:
        """Return that of a camera with a fixed height above the ground and pitch."""
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
                notes.append(item.note)  # without the image
            elif isinstance(item, DroneState):
                states.append(item)
        if not notes:
            raise FileError(reader.path, "the record has no frame with an image")
        return cls(notes, states)

    def frame(self, image: NDArray[np.uint8], index: int, time_s: float) -> Frame:
        """Return an image, (H, W, 3) RGB, as a frame; heights beyond the flight's ends are NaN."""
        known = self.times_s[0] - self._slack_s <= time_s <= self.times_s[-1] + self._slack_s

        def at(columns: Mapping[str, Any]) -> dict[str, float]:
            return {
                name: float(np.interp(time_s, self.times_s, column)) if known else math.nan
                for name, column in columns.items()
            }

        return Frame(
            image=image,
            index=index,
            captured_s=time_s,
            attitude=Attitude(**at(self._angles)),
            **at(self._numbers),
        )

    def states(self, until_s: float) -> list[DroneState]:
        """Return the drone's states since the last call, up to a time of the video."""
        past = []
        # With a tolerance: the video's times are differences.
        while self._states and self._states[0].captured_s <= until_s + 1e-9:
            past.append(self._states.popleft())
        return past
