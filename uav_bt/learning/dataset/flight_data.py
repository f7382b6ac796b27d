"""One recorded flight without its pictures: small enough to keep in memory by the thousand."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from uav_bt.errors import FileError, InputError
from uav_bt.learning.dataset.commands import kind_of, values_of
from uav_bt.record import channels
from uav_bt.record.notes import CommandNote, FrameNote, TickNote
from uav_bt.record.reader import RecordReader, StoredMessage
from uav_bt.record.values import decode
from uav_bt.types import CameraModel, DroneState

__all__ = ["STATE_FIELDS", "FlightData", "read_flight_data"]

STATE_FIELDS: Final = (
    *("roll_rad", "pitch_rad", "yaw_rad"),
    *("forward_mps", "right_mps", "down_mps"),
    *("altitude_m", "height_m", "height_above_carpet_m"),
    *("gimbal_pitch_rad", "battery"),
)
"""What the columns of `FlightData.states` are; see `uav_bt.types.DroneState`."""

_READ: Final = {
    channel.topic: channel
    for channel in (channels.TICK, channels.COMMANDS, channels.STATE, channels.CAMERA_FRAME)
}

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class FlightData:
    """One flight: T ticks, N frames that have a picture."""

    path: Path
    camera: CameraModel
    scene: str  # empty where nobody told
    outcome: str  # empty for a flight that nobody finished
    tick_s: Floats  # (T,) of the mission clock, rising
    states: NDArray[np.float32]  # (T, 11): STATE_FIELDS
    kinds: NDArray[np.int64]  # (T,) of what was sent: MOVEMENT_KINDS
    commands: NDArray[np.float32]  # (T, 4) of what was sent; see `commands.values_of`
    frame_index: NDArray[np.int64]  # (N,) the drone's frame numbers, rising
    captured_s: Floats  # (N,) of the mission clock, rising
    frame_tick: NDArray[np.int64]  # (N,) the tick in which a frame was first the newest
    stored_ns: NDArray[np.int64]  # (N,) where the picture stands, from the record's start

    def __len__(self) -> int:
        """How many frames there are."""
        return len(self.frame_index)

    @property
    def duration_s(self) -> float:
        """From the first tick to the last."""
        return float(self.tick_s[-1] - self.tick_s[0]) if len(self.tick_s) else 0.0


class _Collector:
    """What is read of a flight, message by message."""

    def __init__(self, reader: RecordReader) -> None:
        self._start_ns = reader.timeline.start_ns
        self.tick_s: list[float] = []
        self.states: list[list[float]] = []
        self.kinds: list[int] = []
        self.commands: list[NDArray[np.float32]] = []
        self.frames: list[tuple[int, float, int, int]] = []
        self._frame: FrameNote | None = None

    def add(self, message: StoredMessage) -> None:
        if message.topic == channels.CAMERA_IMAGE.topic:
            self._picture(message.time_ns - self._start_ns)
            return
        channel = _READ[message.topic]
        note = decode(channel.content, json.loads(message.data))  # type: ignore[arg-type]  # a class
        match note:
            case TickNote():
                self.tick_s.append(note.time_s)
            case CommandNote():
                self.kinds.append(kind_of(note.sent.movement))
                self.commands.append(values_of(note.sent.movement))
            case DroneState():
                self.states.append(_columns(note))
            case FrameNote():
                self._frame = note

    def _picture(self, stored_ns: int) -> None:
        # A frame whose picture was left out for want of time is none to learn from.
        if self._frame is not None:
            frame, tick = self._frame, len(self.tick_s) - 1
            self.frames.append((frame.index, frame.captured_s, tick, stored_ns))
            self._frame = None


def read_flight_data(path: Path) -> FlightData:
    """Read a record but for its pictures.

    Raises:
        FileError: it is no whole flight record, or has no frame.
        MissingDependencyError: the extra `record` is not installed.
    """
    reader = RecordReader(path)
    if not reader.finished:
        raise FileError(
            path, "the record was never finished; `mcap recover` makes a whole one of it"
        )
    collector = _Collector(reader)
    try:
        for message in reader.messages((*_READ, channels.CAMERA_IMAGE.topic)):
            collector.add(message)
    except (InputError, ValueError) as error:
        if isinstance(error, FileError):
            raise
        raise FileError(path, f"a message of the record is damaged: {error}") from error
    if reader.damages:
        raise FileError(
            path,
            f"is damaged ({reader.damages[0]}); `mcap recover` saves what is whole",
        )
    whole = min(len(collector.states), len(collector.kinds), len(collector.tick_s))
    frames = [frame for frame in collector.frames if frame[2] < whole]
    if not frames:
        raise FileError(path, "the record has no frame with a picture to learn from")
    columns = list(zip(*frames, strict=True))
    return FlightData(
        path=path,
        camera=reader.camera,
        scene=reader.metadata.get("scene", ""),
        outcome=(reader.end or {}).get("outcome", ""),
        tick_s=np.array(collector.tick_s[:whole]),
        states=np.array(collector.states[:whole], dtype=np.float32),
        kinds=np.array(collector.kinds[:whole], dtype=np.int64),
        commands=np.stack(collector.commands[:whole]),
        frame_index=np.array(columns[0], dtype=np.int64),
        captured_s=np.array(columns[1], dtype=np.float64),
        frame_tick=np.array(columns[2], dtype=np.int64),
        stored_ns=np.array(columns[3], dtype=np.int64),
    )


def _columns(state: DroneState) -> list[float]:
    attitude, velocity = state.attitude, state.velocity
    return [
        *(attitude.roll_rad, attitude.pitch_rad, attitude.yaw_rad),
        *(velocity.forward_mps, velocity.right_mps, velocity.down_mps),
        *(state.altitude_m, state.height_m, state.height_above_carpet_m),
        *(state.gimbal_pitch_rad, state.battery),
    ]
