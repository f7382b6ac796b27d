"""Indices: what a record says beside its pictures, kept beside it, so that it is read once.

An index is a cache: it is made anew when it is absent, damaged, of another version or of another
state of the record, and a folder that cannot be written to only costs time.
"""

from __future__ import annotations

import hashlib
import json
import logging
import os
import zipfile
from contextlib import suppress
from dataclasses import asdict, fields
from pathlib import Path
from typing import Final

import numpy as np

from uav_bt.errors import FileError
from uav_bt.learning.dataset.flight_data import FlightData, read_flight_data
from uav_bt.types import CameraModel

__all__ = ["fingerprint", "flight_data", "index_path"]

_LOG = logging.getLogger(__name__)
_VERSION: Final = 1  # of the index; another one is made anew
_END_BYTES: Final = 64 * 1024  # of either end: a finished record tells there what is in it
_TEXTS: Final = ("scene", "outcome")


def index_path(record: Path, folder: Path | None = None) -> Path:
    """Return where the index of a record is kept.

    Args:
        record: the record.
        folder: for all indices; None: beside each record.
    """
    if folder is None:
        return record.with_name(record.name + ".index.npz")
    # Records of one name may lie in many folders.
    home = hashlib.sha256(str(record.resolve().parent).encode()).hexdigest()[:8]
    return folder / f"{record.name}-{home}.index.npz"


def fingerprint(record: Path) -> str:
    """Return what tells one state of a record from another: size, time of change, both ends.

    Raises:
        FileError: it cannot be read.
    """
    try:
        told = record.stat()
        with record.open("rb") as file:
            digest = hashlib.sha256(file.read(_END_BYTES))
            file.seek(max(0, told.st_size - _END_BYTES))
            digest.update(file.read())
    except OSError as error:
        raise FileError(record, f"cannot be read: {error.strerror or error}") from error
    return f"{_VERSION} {told.st_size} {told.st_mtime_ns} {digest.hexdigest()}"


def flight_data(record: Path, folder: Path | None = None) -> FlightData:
    """Return a record's data, from its index where that is of today.

    Args:
        record: the record.
        folder: where indices are kept; None: beside each record.

    Raises:
        FileError: it is no whole flight record, or has no frame.
    """
    state, index = fingerprint(record), index_path(record, folder)
    kept = _kept(record, index, state)
    if kept is not None:
        return kept
    made = read_flight_data(record)
    _keep(index, made, state)
    return made


def _kept(record: Path, index: Path, state: str) -> FlightData | None:
    try:
        with index.open("rb") as file, np.load(file, allow_pickle=False) as content:
            if str(content["state"]) != state:
                return None
            arrays = {name: content[name] for name in content.files}
        about = json.loads(str(arrays.pop("about")))
        arrays.pop("state")
        camera = CameraModel(
            **{**about["camera"], "distortion": tuple(about["camera"]["distortion"])}
        )
        return FlightData(
            path=record, camera=camera, **{name: about[name] for name in _TEXTS}, **arrays
        )
    except FileNotFoundError:
        return None
    except (OSError, ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile) as error:
        _LOG.info("index %s is made anew: %s", index, error)
        return None


def _keep(index: Path, made: FlightData, state: str) -> None:
    about = {"camera": asdict(made.camera), **{name: getattr(made, name) for name in _TEXTS}}
    arrays = {
        item.name: getattr(made, item.name)
        for item in fields(FlightData)
        if item.name not in ("path", "camera", *_TEXTS)
    }
    # Several processes may index one record at once: each writes a file of its own.
    partial = index.with_name(f"{index.name}.{os.getpid()}.part")
    try:
        index.parent.mkdir(parents=True, exist_ok=True)
        with partial.open("wb") as file:
            np.savez(file, state=np.array(state), about=np.array(json.dumps(about)), **arrays)
        partial.replace(index)
    except OSError as error:
        with suppress(OSError):  # it may not even have begun
            partial.unlink(missing_ok=True)
        _LOG.warning(
            "index %s cannot be kept (%s): the record is read anew each time", index, error
        )
