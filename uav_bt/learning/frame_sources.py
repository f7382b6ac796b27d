"""Videos, flight records and photographs that a lab's images are taken from."""

from __future__ import annotations

from collections.abc import Generator, Iterable, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final, Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.camera.image_files import FOREIGN_SUFFIXES, IMAGE_SUFFIXES
from uav_bt.app.sources.video_source import VideoSource
from uav_bt.errors import FileError, InputError
from uav_bt.files import did_you_mean_file
from uav_bt.record.footage import RECORD_SUFFIX, flight_record, footage
from uav_bt.record.moment import StoredFrame
from uav_bt.types.arrays import Image

SMALLEST_PX: Final = (224, 112)
"""Longer and shorter side of the smallest images."""

_VIDEO_SUFFIXES: Final = (
    *(".3gp", ".avi", ".m2ts", ".m4v", ".mkv", ".mov", ".mp4", ".mpg", ".mts", ".ts", ".webm"),
)
_UNKNOWN_DURATION_S: Final = 60.0  # of a video that states none; it shares the images
_NAMED: Final = 3  # files that a message lists


class Shot(Protocol):
    """An image with its time, converted on demand."""

    @property
    def time_s(self) -> float:
        """Time since the source began."""
        ...

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height."""
        ...

    def shrunk(self, size_px: tuple[int, int], *, colour: bool) -> NDArray[np.uint8]:
        """Return the image at another size, (H, W, 3) uint8 RGB or (H, W) uint8."""
        ...


Shots = Generator[Shot, None, None]
"""Images in order of time; closing lets go of the file."""


@dataclass(frozen=True, kw_only=True, eq=False)
class WholeShot:
    """An image that is an array already."""

    array: Image  # (H, W, 3) RGB
    time_s: float = 0.0

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height."""
        return self.array.shape[1], self.array.shape[0]

    def shrunk(self, size_px: tuple[int, int], *, colour: bool) -> NDArray[np.uint8]:
        """Return the image at another size, (H, W, 3) uint8 RGB or (H, W) uint8."""
        array = self.array if colour else cv2.cvtColor(self.array, cv2.COLOR_RGB2GRAY)
        shrinks = size_px[0] < self.size_px[0]
        interpolation = cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR
        return np.asarray(cv2.resize(array, size_px, interpolation=interpolation), dtype=np.uint8)


@dataclass(frozen=True, kw_only=True)
class Filmed:
    """A video file or a flight record.

    Attributes:
        name: Name in the list of images, different for each source.
        path: The file.
        duration_s: About how long it is.
        skipped: Images that could not be read, with the reasons; filled while shots are read.
    """

    name: str
    path: Path
    duration_s: float
    skipped: list[str] = field(default_factory=list)

    def shots(self) -> Shots:
        """Iterate over all images.

        Raises:
            FileError: The file cannot be read.
        """
        if _is_record(self.path):
            yield from _recorded(self.path, self.skipped)
            return
        source = VideoSource(self.path)
        try:
            with closing(source.decoded()) as decoded:
                yield from decoded
        finally:
            self.skipped.extend(source.skipped)


@dataclass(frozen=True, kw_only=True)
class Photograph:
    """An image file.

    Attributes:
        name: Name in the list of images, different for each source.
        path: The file.
    """

    name: str
    path: Path


@dataclass(frozen=True, kw_only=True)
class FrameSources:
    """All that images are taken from.

    Attributes:
        filmed: Videos and records, in the order in which they were named.
        photographs: Image files by name.
        notes: Lines about files that are not read.
    """

    filmed: tuple[Filmed, ...]
    photographs: tuple[Photograph, ...]
    notes: tuple[str, ...]


def find_sources(paths: Sequence[Path], own: Path) -> FrameSources:
    """Find videos, records and photographs, and open each video once.

    Args:
        paths: Files, and folders of which all files below are taken that have a known suffix.
        own: Folder of the lab's images, which are no sources.

    Raises:
        FileError: A file or folder is absent, a folder holds nothing, or a video cannot be read.
        InputError: All that was named is in formats that are not read.
    """
    files: dict[Path, Path] = {}  # by the resolved path: each file is read once
    foreign: list[Path] = []
    for path in paths:
        for file in _files(path, own):
            if file.suffix.lower() in FOREIGN_SUFFIXES:
                foreign.append(file)
            else:
                files.setdefault(file.resolve(), file)
    names = _names(files.values())
    photographs = [
        Photograph(name=names[file], path=file) for file in files.values() if _is_photograph(file)
    ]
    note = _conversion(foreign)
    if foreign and not files:
        raise InputError(note)
    filmed = [_opened(names[file], file) for file in files.values() if not _is_photograph(file)]
    return FrameSources(
        filmed=tuple(filmed),
        photographs=tuple(sorted(photographs, key=lambda one: one.name)),
        notes=(note,) if foreign else (),
    )


def check_size(path: Path, size_px: tuple[int, int]) -> None:
    """Refuse images that are too small to learn from.

    Raises:
        FileError: They are smaller than `SMALLEST_PX`.
    """
    if max(size_px) < SMALLEST_PX[0] or min(size_px) < SMALLEST_PX[1]:
        raise FileError(
            path,
            f"the images must have at least {SMALLEST_PX[0]}x{SMALLEST_PX[1]} pixels, got "
            f"{size_px[0]}x{size_px[1]}; take the camera's own file, not a preview",
        )


def _files(path: Path, own: Path) -> list[Path]:
    if not path.exists():
        raise FileError(
            path, f"there is no such video, photograph or folder{did_you_mean_file(path)}"
        )
    if own.resolve() in (path.resolve(), *path.resolve().parents):
        raise FileError(path, "is in the folder of the lab's images; name the videos they are from")
    if not path.is_dir():
        return [path]
    known = (*_VIDEO_SUFFIXES, *IMAGE_SUFFIXES, *FOREIGN_SUFFIXES, ".mcap")
    found = [
        file
        for file in sorted(path.rglob("*"))
        if file.suffix.lower() in known
        and not file.name.startswith(".")  # macOS puts ._NAME beside each file of a memory card
        and file.is_file()
        and own.resolve() not in file.resolve().parents
    ]
    if not found:
        raise FileError(path, "the folder holds no video, flight record or photograph")
    return found


def _names(files: Iterable[Path]) -> dict[Path, str]:
    """Return a different name for each file: the file name, with the folder where two are equal."""
    names: dict[Path, str] = {}
    for file in files:
        # Names that are not UTF-8 cannot be written to a list.
        own, parent = (
            text.encode("utf-8", "replace").decode()
            for text in (file.name, file.resolve().parent.name)
        )
        name, number = own, 1
        while name in names.values():
            name = f"{parent}/{own}" if number == 1 else f"{parent}-{number}/{own}"
            number += 1
        names[file] = name
    return names


def _conversion(foreign: Sequence[Path]) -> str:
    names = ", ".join(str(path) for path in foreign[:_NAMED])
    more = f" and {len(foreign) - _NAMED} more" if len(foreign) > _NAMED else ""
    return f"{names}{more}: a format that is not read; convert photographs to JPEG or PNG"


def _is_photograph(path: Path) -> bool:
    return path.suffix.lower() in IMAGE_SUFFIXES


def _is_record(path: Path) -> bool:
    return path.suffix.lower() == RECORD_SUFFIX


def _opened(name: str, path: Path) -> Filmed:
    if _is_record(path):
        items = footage(flight_record(path))
        times_s = [item.note.captured_s for item in items if isinstance(item, StoredFrame)]
        duration_s = times_s[-1] - times_s[0] if times_s else 0.0
    else:
        video = VideoSource(path)
        duration_s = video.total / video.rate_per_s if video.total else _UNKNOWN_DURATION_S
    skipped: list[str] = []
    with closing(
        Filmed(name=name, path=path, duration_s=duration_s, skipped=skipped).shots()
    ) as shots:
        first = next(shots, None)
    if first is None:
        why = f" ({skipped[0]})" if skipped else ""
        raise FileError(path, f"holds no image that can be read{why}; film or copy it again")
    check_size(path, first.size_px)
    return Filmed(name=name, path=path, duration_s=duration_s)


def _recorded(path: Path, skipped: list[str]) -> Shots:
    begin_s: float | None = None
    for item in footage(flight_record(path)):
        if not isinstance(item, StoredFrame):
            continue
        begin_s = item.note.captured_s if begin_s is None else begin_s
        try:
            image = item.frame().image
        except InputError as error:
            skipped.append(f"frame {item.note.index}: {error}")
            continue
        yield WholeShot(array=image, time_s=item.note.captured_s - begin_s)
