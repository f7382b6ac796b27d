"""Flight records as what networks learn from: which files, which frames, and footage in memory."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from perception.odometry.camera_track import FOOTAGE_SIZE_PX, Footage, shrink
from uav_bt.errors import FileError, InputError
from uav_bt.files import reading
from uav_bt.record.footage import flight_record, footage
from uav_bt.record.moment import StoredFrame
from uav_bt.types import Attitude, DroneState

_FOOTAGE_EVERY_S: Final = 0.1  # a tick
_END_BYTES: Final = 64 * 1024  # of either end: a finished record tells there what is in it


# --- files ----------------------------------------------------------------------------------------


def records_of(paths: Sequence[Path]) -> list[Path]:
    """Return the records that paths stand for: files, and all below folders, each once.

    Raises:
        FileError: a folder has none.
    """
    found: dict[Path, None] = {}
    for path in paths:
        records = sorted(path.rglob("*.mcap")) if path.is_dir() else [path]
        if not records:
            raise FileError(path, "there is no flight record in this folder")
        found |= dict.fromkeys(records)
    return list(found)


def split_records(paths: Sequence[Path], held_out: Sequence[Path]) -> tuple[list[Path], list[Path]]:
    """Return the records to train on, and those to measure on.

    Args:
        paths: files and folders; what is also held out is not trained on.
        held_out: files and folders.

    Raises:
        FileError: a folder has no record.
        InputError: nothing is left to train on.
    """
    others = records_of(held_out)
    learnt = [record for record in records_of(paths) if record not in others]
    if not learnt:
        raise InputError(
            f"all records to learn from are held out to measure on ({len(others)} records): name "
            "others to learn from"
        )
    return learnt, others


def fingerprint(record: Path) -> str:
    """Return what identifies a state of a record: a hash of its size, time of change and ends.

    Raises:
        FileError: it cannot be read.
    """
    with reading(record), record.open("rb") as file:
        status = record.stat()
        digest = hashlib.sha256(file.read(_END_BYTES))
        file.seek(max(0, status.st_size - _END_BYTES))
        digest.update(file.read())
    digest.update(f"{status.st_size} {status.st_mtime_ns}".encode())
    return digest.hexdigest()[:12]


# --- frames ---------------------------------------------------------------------------------------


def spaced(frames: Iterable[StoredFrame], every_s: float) -> Iterator[StoredFrame]:
    """Yield frames at least about `every_s` apart, each once.

    Args:
        frames: in the order of time.
        every_s: frames have a rhythm of their own: one that is three quarters due is taken.
    """
    last: StoredFrame | None = None
    for frame in frames:
        if last is not None:
            passed_s = frame.note.captured_s - last.note.captured_s
            if frame.note.index <= last.note.index or passed_s < 0.75 * every_s:
                continue
        last = frame
        yield frame


def image_of(frame: StoredFrame, record: Path) -> NDArray[np.uint8]:
    """Decode a frame's image, (H, W, 3) RGB.

    Raises:
        FileError: it is damaged; names the record.
    """
    try:
        return frame.frame().image
    except InputError as error:
        raise FileError(record, f"frame {frame.note.index} is damaged: {error}") from error


def footage_of(path: Path) -> Footage:
    """Read a record's frames, ten a second at the depth network's size, and its telemetry.

    Raises:
        FileError: it is no whole flight record, or has no frame.
    """
    reader = flight_record(path)
    states: list[DroneState] = []

    def frames() -> Iterator[StoredFrame]:
        for item in footage(reader):
            if isinstance(item, StoredFrame):
                yield item
            elif isinstance(item, DroneState) and (
                not states or item.captured_s > states[-1].captured_s
            ):
                states.append(item)

    images, notes = [], []
    for frame in spaced(frames(), _FOOTAGE_EVERY_S):
        images.append(shrink(image_of(frame, path)))
        notes.append(frame.note)
    if not notes:
        raise FileError(path, "the record has no frame with an image to learn from")
    return Footage(
        frames=np.stack(images),
        index=np.array([note.index for note in notes], dtype=np.int64),
        captured_s=np.array([note.captured_s for note in notes]),
        gimbal_pitch_rad=np.array([note.gimbal_pitch_rad for note in notes]),
        attitude_rad=np.array([_angles(note.attitude) for note in notes]),
        altitude_m=np.array([note.altitude_m for note in notes]),
        height_m=np.array([note.height_m for note in notes]),
        height_above_carpet_m=np.array([note.height_above_carpet_m for note in notes]),
        state_s=np.array([state.captured_s for state in states]),
        state_attitude_rad=np.array([_angles(state.attitude) for state in states]),
        velocity_mps=np.array(
            [
                (state.velocity.forward_mps, state.velocity.right_mps, state.velocity.down_mps)
                for state in states
            ]
        ),
        camera=reader.camera.resized(*FOOTAGE_SIZE_PX),
    )


def _angles(attitude: Attitude) -> tuple[float, float, float]:
    return attitude.roll_rad, attitude.pitch_rad, attitude.yaw_rad
