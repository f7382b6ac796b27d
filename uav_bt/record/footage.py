"""Frames, states and advice of a record, for perception and training.

for item in footage(flight_record(Path("flight.mcap"))):
    ...
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

from uav_bt.errors import FileError, InputError
from uav_bt.json_text import parse_json
from uav_bt.protocols import Advice
from uav_bt.record import channels
from uav_bt.record.channels import FrameNote
from uav_bt.record.images import image_bytes
from uav_bt.record.moment import StoredFrame
from uav_bt.record.reader import RecordReader
from uav_bt.record.values import decode, decode_float
from uav_bt.types import DroneState

FLIGHT_SUFFIXES: Final = (".mcap", ".npz")  # .npz is refused with a remedy

_DECODED: Final[dict[str, type[Any]]] = {
    channels.ADVICE.topic: Advice,
    channels.CAMERA_FRAME.topic: FrameNote,
    channels.STATE.topic: DroneState,
}


def flight_record(path: Path) -> RecordReader:
    """Open a finished record.

    Raises:
        FileError: the file is not a flight record, or was never finished.
        MissingDependencyError: the extra `record` is not installed.
    """
    if path.suffix.lower() == ".npz":
        raise FileError(
            path,
            "flights are kept as records: fly it again with `uav-bt fly ... --record FILE.mcap`",
        )
    reader = RecordReader(path)
    if not reader.finished:
        raise FileError(path, "the record was never finished; `mcap recover` makes a whole one")
    return reader


def footage(reader: RecordReader) -> Iterator[StoredFrame | DroneState | Advice]:
    """Yield frames with an image, states and advice, in the order of time.

    Args:
        reader: reader of the record. Images are decoded on access; other channels are not decoded.

    Raises:
        FileError: the record is damaged.
    """
    note: FrameNote | None = None
    try:
        for message in reader.messages((*_DECODED, channels.CAMERA_IMAGE.topic)):
            if message.topic != channels.CAMERA_IMAGE.topic:
                plain = parse_json(message.data)
                if message.topic == channels.ADVICE.topic:
                    plain = _advice(plain)
                found = decode(_DECODED[message.topic], plain)
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


def _advice(plain: Any) -> Any:
    """Return advice in the present form.

    In schema version 1 all answers were of one class, with the fields of all.
    """
    if not (isinstance(plain, dict) and "decision" in plain):
        return plain
    return plain | {"answer": _answer(plain["decision"]), "fresh": _answer(plain.get("fresh"))}


def _answer(old: Any) -> Any:
    if not isinstance(old, dict):
        return old
    forward_m = decode_float(old.get("forward_m"))
    if old.get("done"):
        kind = "Done"
    elif old.get("speed_mps") is not None:
        kind = "FollowLeg" if old["speed_mps"] else "Rotate"
    else:
        kind = "Advance" if forward_m > 0.0 else "Blocked"
    # Each class reads its fields and ignores the others.
    return {**old, "type": kind, "ground_ends": old.get("carpet_ends", False)}
