"""Files that are written completely or not at all, and file errors as `FileError`."""

from __future__ import annotations

import json
import math
import os
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final, NoReturn

from uav_bt.errors import FileError, InputError, did_you_mean

Failure = Callable[[Path, str], FileError]  # makes the error of a path and a message


def did_you_mean_file(path: Path) -> str:
    """Return ``"; did you mean 'x'?"`` for a file or folder beside a missing one, or nothing."""
    beside = path.parent.iterdir() if path.parent.is_dir() else ()
    stems = [one.stem for one in beside if one.suffix == path.suffix]
    return did_you_mean(path.stem, stems, suffix=path.suffix)


@contextmanager
def reading(path: Path, error: Failure = FileError) -> Iterator[None]:
    """Translate the errors of a block that reads a file, also that it is not UTF-8 text."""
    try:
        yield
    except UnicodeDecodeError as cause:
        raise error(path, f"cannot be read as UTF-8 text: {cause}") from cause
    except FileNotFoundError as cause:
        raise error(path, f"no such file{did_you_mean_file(path)}") from cause
    except OSError as cause:
        raise error(path, f"cannot be read: {cause.strerror or cause}") from cause


def read_bounded(
    path: Path, max_bytes: int, error: Failure = FileError, *, cure: str = ""
) -> bytes:
    """Return a file's bytes; refuse one that is absent, not regular or too large."""
    with reading(path, error):
        if path.exists() and not path.is_file():
            raise error(path, f"is a {'folder' if path.is_dir() else 'device or a pipe'}, no file")
        with path.open("rb") as file:
            data = file.read(max_bytes + 1)
    if len(data) > max_bytes:
        raise error(path, f"larger than {max_bytes} bytes{f': {cure}' if cure else ''}")
    return data


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Translate the errors of the system in a block that writes a file."""
    try:
        yield
    except OSError as cause:
        raise FileError(path, f"cannot be written: {cause.strerror or cause}") from cause


def check_output(path: Path, *, new_folders: bool = False) -> None:
    """Refuse a file that cannot be written, before the work whose result it will have.

    With `new_folders` its folder may be missing, because it will be made.
    """
    with writing(path):
        if path.is_dir():
            raise FileError(path, "is a folder; name a file in it")
        if path.exists() and not path.is_file():
            raise FileError(path, "is a device or a pipe, and not to be replaced by a file")
        if not new_folders and not path.parent.exists():
            raise FileError(path, f"folder '{path.parent}' does not exist; create it first")
    check_output_folder(path.parent)


def check_output_folder(folder: Path) -> None:
    """Refuse a folder that cannot be written to or made."""
    with writing(folder):
        there = next(path for path in (folder, *folder.absolute().parents) if path.exists())
        if not there.is_dir():
            raise FileError(folder, f"cannot be written to: '{there}' is a file and no folder")
        # Permissions are not enough: /proc refuses every user.
        with tempfile.TemporaryFile(dir=there):
            pass


def check_empty_folder(folder: Path, writer: str) -> None:
    """Refuse a folder that has files, or that cannot be written to or made, for a writer."""
    check_output_folder(folder)
    with writing(folder):
        if folder.is_dir() and any(folder.iterdir()):
            needed = f"{writer} writes to an empty or a new folder"
            raise FileError(folder, f"has files, and {needed}: name another one, or empty this one")


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Write a file so that a reader never sees half of it.

    The block writes to the yielded path beside the final one. If it ends without an error, that
    file replaces the final one; otherwise it is removed.
    """
    # Several processes may write one file at once, such as an index: each has a separate part.
    partial = path.with_name(f"{path.name}.{os.getpid()}.part")
    with writing(path):
        try:
            yield partial
            partial.replace(path)
        finally:
            partial.unlink(missing_ok=True)


def write_whole(path: Path, content: bytes | str) -> None:
    """Write a file so that a reader never sees half of it; text becomes UTF-8."""
    with whole_file(path) as partial:
        partial.write_bytes(content.encode() if isinstance(content, str) else content)


_MAX_DEPTH: Final = 64  # ours has less than ten; `repr` and our walks recurse


def parse_json(text: bytes | str) -> Any:
    """Return the value of a JSON text (bytes are UTF-8); InputError for any other."""
    try:
        text = text.decode() if isinstance(text, bytes) else text
        value = _DECODER.decode(text)
        deep = text.count("[") + text.count("{") > _MAX_DEPTH and _depth(value) > _MAX_DEPTH
    except ValueError as error:  # also not UTF-8, or an integer of thousands of digits
        raise InputError(f"no JSON: {error}") from error
    except RecursionError:
        deep = True
    if deep:
        raise InputError(f"no JSON that can be read: nested deeper than {_MAX_DEPTH}")
    return value


def _depth(value: Any) -> int:
    inner = value.values() if isinstance(value, dict) else value
    return 1 + max(map(_depth, inner), default=0) if isinstance(value, dict | list) else 0


def _finite(text: str) -> float:
    value = float(text)
    if math.isinf(value):
        raise InputError(f"no JSON that can be read: {text:.40} is beyond a double's range")
    return value


def _refuse(name: str) -> NoReturn:
    raise InputError(f"{name} is not JSON")


_DECODER: Final = json.JSONDecoder(parse_float=_finite, parse_constant=_refuse)
