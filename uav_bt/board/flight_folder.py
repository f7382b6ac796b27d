"""The folder that a flight's leaves and its report write their files to."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path
from typing import Final

from uav_bt.errors import FileError
from uav_bt.files import check_empty_folder, write_whole, writing

_NAME: Final = re.compile(r"[A-Za-z0-9][\w.\-]{0,99}", re.ASCII)


class FlightFolder:
    """The output folder of one flight, new or empty; leaves may not use the reserved names.

    It is made with the first file.
    """

    def __init__(self, folder: Path, reserved: Iterable[str] = ()) -> None:
        check_empty_folder(folder, "a flight")
        self.folder = folder
        self._reserved = frozenset(reserved)

    def write(self, name: str, content: bytes | str) -> None:
        """Write a new file; a reader never sees half of it, and text becomes UTF-8."""
        path = self.folder / name
        if not _NAME.fullmatch(name):
            raise FileError(
                name,
                "is no name of a file in the flight's folder: expected letters, digits, '_', '-' "
                "and '.', without folders",
            )
        if name in self._reserved:
            raise FileError(path, "is the name of another output of the flight; use another name")
        self.make()
        with writing(path):
            if path.exists() or path.is_symlink():
                raise FileError(path, "exists already; use another name")
        write_whole(path, content)

    def make(self) -> None:
        """Make the folder."""
        with writing(self.folder):
            self.folder.mkdir(parents=True, exist_ok=True)
