"""The files that a command or a flight reads: no output may overwrite one of them."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Final

from uav_bt.errors import FileError

_NAMING: Final = {".xml", ".yaml", ".yml"}  # files that name further ones
# How a file names others: quoted in XML, after a colon or a dash in YAML.
_NAMED: Final = re.compile(r"""["']([^"'\n]+)["']|[:\-][ \t]+([^"'\n#]+)""")
# Suffixes and names of the files that are read from a folder. Its other JSON files are outputs.
_IN_FOLDERS: Final = {
    *(".mcap", ".jsonl", ".csv", ".onnx", ".obj", *_NAMING),
    *(".jpg", ".jpeg", ".png", ".tif", ".tiff", ".bmp", ".webp"),
    *("campaign.json", "classes.json"),
}


def refuse_inputs(output: Path, given: Iterable[object], shipped: Path) -> None:
    """Refuse an output that is one of the inputs, or a file that one of these names.

    Args:
        output: the file to be written.
        given: the inputs: files, folders, names, and mappings, sequences and dataclass objects
            that contain them; other values are ignored.
        shipped: the folder of the shipped missions, which are given by name.
    """
    if output.exists() and any(same_file(output, source) for source in _inputs(given, shipped)):
        raise FileError(output, "is an input and would be overwritten; choose another name")


def same_file(one: Path, other: Path) -> bool:
    """Return whether two paths are one file, also by a link."""
    if one.exists() and other.exists():
        return one.samefile(other)
    return one.resolve() == other.resolve()


def _inputs(given: Iterable[object], shipped: Path) -> Iterator[Path]:
    found: dict[Path, None] = {}
    for text in (text for value in given for text in _texts(value)):
        _add(_files(text, Path()), found)
        _add(_files(f"{Path(text).stem}.xml", shipped), found)
    yield from found


def _texts(value: object) -> Iterator[str]:
    """Yield the texts in a value."""
    if isinstance(value, (str, Path)):
        yield str(value)
    elif isinstance(value, Mapping):
        yield from (text for each in value.values() for text in _texts(each))
    elif isinstance(value, (tuple, list)):
        yield from (text for each in value for text in _texts(each))
    elif is_dataclass(value):
        yield from (text for each in fields(value) for text in _texts(getattr(value, each.name)))


def _add(paths: Iterable[Path], found: dict[Path, None]) -> None:
    for path in paths:
        if path in found:
            continue
        found[path] = None
        if path.suffix.lower() in _NAMING and os.access(path, os.R_OK):
            text = path.read_bytes().decode("utf-8", "replace")
            for match in _NAMED.finditer(text):
                name = match[1] or match[2]
                _add(_files(name.strip(), path.parent), found)
                _add(_files(name.strip(), Path()), found)


def _files(text: str, folder: Path) -> Iterator[Path]:
    """Yield the files that a text may name: FILE, NAME:FILE, a list with commas, a folder."""
    for part in {text, text.partition(":")[2], *text.split(",")}:
        path = folder / part
        with suppress(OSError):  # not a valid file name
            if part and path.is_file():
                yield path.resolve()
            elif part == text and folder == Path() and path.is_dir():
                for file in path.rglob("*"):
                    if {file.suffix.lower(), file.name} & _IN_FOLDERS:
                        yield file
