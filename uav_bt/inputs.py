"""The files that a command or a flight reads: no output may overwrite one of them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import is_dataclass
from pathlib import Path
from typing import Final

from uav_bt.errors import FileError

_TEXT_BYTES: Final = 1_000_000  # a larger file names no others; chosen, tree files are smaller
# How a text file names others: quoted in XML and Python, after a colon or a dash in YAML.
_NAMED: Final = re.compile(r"""["']([^"'\n]+)["']|[:\-][ \t]+([^"'\n#]+)""")
# In a folder every file is an input, but those that a command may have written there before.
_REWRITTEN: Final = {".json", ".html", ".mp4", ".pdf", ".rrd", ".svg", ".btlog"}
_READ: Final = {"campaign.json", "classes.json"}


def refuse_inputs(output: Path, given: Iterable[object], shipped: Path) -> None:
    """Refuse an output that is one of the inputs, or a file that one of these names.

    Inputs are files, folders and names in any values; `shipped` has the missions given by name.
    """
    if output.exists() and any(same_file(output, source) for source in inputs(given, shipped)):
        raise FileError(output, "is an input and would be overwritten; choose another name")


def same_file(one: Path, other: Path) -> bool:
    """Return whether two paths are one file, also by a link."""
    if one.exists() and other.exists():
        return one.samefile(other)
    return one.resolve() == other.resolve()


def inputs(given: Iterable[object], shipped: Path) -> set[Path]:
    """Return the files in the given values, and those that text files among them name."""
    found: set[Path] = set()
    waiting: list[Path] = []
    for text in _texts(tuple(given)):
        waiting += [*_files(text, Path()), *_files(f"{Path(text).stem}.xml", shipped)]
    while waiting:
        path = waiting.pop()
        if path not in found:
            found.add(path)
            waiting += _named(path)
    return found


def _texts(value: object) -> Iterator[str]:
    """Yield the texts in a value."""
    if isinstance(value, (str, Path)):
        yield str(value)
    if is_dataclass(value):
        value = vars(value)
    if isinstance(value, Mapping):
        value = [*value.values()]
    for part in value if isinstance(value, (tuple, list)) else ():
        yield from _texts(part)


def _named(path: Path) -> Iterator[Path]:
    """Yield the files that a text file names, whatever its suffix."""
    with suppress(OSError):  # it cannot be read
        text = path.read_bytes() if path.stat().st_size <= _TEXT_BYTES else b"\0"
        for match in _NAMED.finditer("" if b"\0" in text else text.decode("utf-8", "replace")):
            for folder in (path.parent, Path()):
                yield from _files((match[1] or match[2]).strip(), folder)


def _files(text: str, folder: Path) -> Iterator[Path]:
    """Yield the files that a text may name: FILE, NAME:FILE, a list with commas, a folder."""
    for part in {text, text.partition(":")[2], *text.split(",")}:
        path = folder / part
        with suppress(OSError):  # not a valid file name
            if part and path.is_file():
                yield path.resolve()
            elif part == text and folder == Path() and path.is_dir():
                for file in path.rglob("*"):
                    if file.suffix.lower() not in _REWRITTEN or file.name in _READ:
                        yield file
