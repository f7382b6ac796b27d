"""Footage for the depth network, from a footage file or from a record."""

from __future__ import annotations

from pathlib import Path

from perception.footage.file import Footage, read_footage
from uav_bt.app.footage import FootageConfig, FootageRecorder
from uav_bt.errors import FileError, ValueRangeError
from uav_bt.record.playback import Playback
from uav_bt.record.reader import RecordReader

__all__ = ["RECORD_SUFFIX", "footage_of", "footage_of_record"]

RECORD_SUFFIX = ".mcap"


def footage_of(path: Path) -> Footage:
    """Return a flight's footage.

    Args:
        path: what `uav-bt fly` wrote with `--footage` (npz) or with `--record` (mcap).

    Raises:
        FileError: it is neither, or damaged.
    """
    return footage_of_record(path) if path.suffix.lower() == RECORD_SUFFIX else read_footage(path)


def footage_of_record(path: Path, config: FootageConfig | None = None) -> Footage:
    """Return the footage that a record holds: what `--footage` would have kept of that flight.

    Raises:
        FileError: it is no flight record, or has no frame.
    """
    reader = RecordReader(path)
    recorder = FootageRecorder(reader.camera, config)
    for tick in Playback(reader).ticks():
        recorder.on_tick(tick)
    try:
        return recorder.footage()
    except ValueRangeError as error:
        raise FileError(path, str(error)) from error
