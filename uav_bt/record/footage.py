"""Frames, states and advice of a record, for perception and training.

for item in footage(flight_record(Path("flight.mcap"))):
    ...
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

from uav_bt.errors import FileError, InputError
from uav_bt.files import parse_json
from uav_bt.protocols import Advice
from uav_bt.record import channels
from uav_bt.record.channels import FrameNote
from uav_bt.record.images import image_bytes
from uav_bt.record.moment import StoredFrame
from uav_bt.record.reader import RecordReader
from uav_bt.record.values import decode
from uav_bt.types import DroneState

RECORD_SUFFIX: Final = ".mcap"

_DECODED: Final[dict[str, type[Any]]] = {
    channels.ADVICE.topic: Advice,
    channels.CAMERA_FRAME.topic: FrameNote,
    channels.STATE.topic: DroneState,
}


def flight_record(path: Path) -> RecordReader:
    """Open a finished record; FileError if it is none."""
    reader = RecordReader(path)
    if not reader.finished:
        raise FileError(path, "the record was never finished; `mcap recover` makes a whole one")
    return reader


def footage(reader: RecordReader) -> Iterator[StoredFrame | DroneState | Advice]:
    """Yield frames with an image, states and advice, in the order of time.

    Images are decoded on access. FileError if the record is damaged.
    """
    note: FrameNote | None = None
    try:
        for message in reader.messages((*_DECODED, channels.CAMERA_IMAGE.topic)):
            if message.topic != channels.CAMERA_IMAGE.topic:
                found = decode(_DECODED[message.topic], parse_json(message.data))
                if isinstance(found, FrameNote):
                    note = found
                else:
                    yield found
            elif note is not None:
                yield StoredFrame(note=note, image=image_bytes(message.data))
                note = None
    except FileError:
        raise
    except InputError as error:
        raise FileError(reader.path, f"a message of the record is damaged: {error}") from error
    if reader.damages:
        raise FileError(
            reader.path, f"is damaged ({reader.damages[0]}); `mcap recover` saves the intact part"
        )
