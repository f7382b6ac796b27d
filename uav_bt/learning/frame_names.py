"""Names of a lab's images, and moving them into its folder without overwriting anything."""

from __future__ import annotations

import filecmp
import re
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from uav_bt.files import writing
from uav_bt.learning.lab_material import LabFrame

_LONGEST: Final = 60  # characters
_TIME: Final = re.compile(r"-\d{5,}\.\d(-\d+)?$")


def free_stem(source: str, listed: Iterable[LabFrame]) -> str:
    """Return the beginning of the image names of a source, which no other source has.

    Args:
        source: Name of the source.
        listed: Images of other sources.
    """
    suffix = Path(source).suffix
    cleaned = re.sub(r"[^\w.-]+", "-", source.removesuffix(suffix)).strip(".-")[:_LONGEST]
    # Some file systems do not distinguish capitals.
    taken = {_TIME.sub("", Path(frame.image).stem).casefold() for frame in listed}
    return _first_free(cleaned or "video", "", taken)


def image_name(stem: str, time_s: float | None) -> str:
    """Return the file name of an image; a photograph has no time."""
    return f"{stem}.jpg" if time_s is None else f"{stem}-{time_s:07.1f}.jpg"


@contextmanager
def moved(files: Sequence[tuple[Path, str]], folder: Path) -> Iterator[list[str]]:
    """Move files into a folder; if the block inside fails, they are removed from it again.

    A file that exists there stays. If its content is the same, as after a run that was killed, it
    is used; otherwise the new file gets a number.

    Args:
        files: Files with the names that they shall have.
        folder: Where they are moved.

    Yields:
        The names that they have.

    Raises:
        FileError: A file cannot be moved.
    """
    taken = {path.name.casefold() for path in folder.iterdir()}
    names: list[str] = []
    mine: list[Path] = []
    try:
        for file, wished in files:
            name = wished
            if name in names or not _same(file, folder / name):
                name = _first_free(Path(wished).stem, ".jpg", taken)
                mine.append(folder / name)
                with writing(folder / name):
                    file.rename(folder / name)
            names.append(name)
            taken.add(name.casefold())
        yield names
    except BaseException:
        for path in mine:
            path.unlink(missing_ok=True)
        raise


def _same(file: Path, other: Path) -> bool:
    return other.is_file() and filecmp.cmp(file, other, shallow=False)


def _first_free(stem: str, suffix: str, taken: set[str]) -> str:
    name, number = f"{stem}{suffix}", 1
    while name.casefold() in taken:
        number += 1
        name = f"{stem}-{number}{suffix}"
    return name
