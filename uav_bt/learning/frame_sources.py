"""Videos, flight records and photographs that a lab's images are taken from."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from perception.camera.image_files import FOREIGN_SUFFIXES, IMAGE_SUFFIXES
from uav_bt.app.sources.by_name import RecordSource
from uav_bt.app.sources.shots import ImageSource
from uav_bt.app.sources.video_source import VideoSource
from uav_bt.errors import FileError, InputError
from uav_bt.files import did_you_mean_file
from uav_bt.learning.lab_material import LabFrame, fingerprint
from uav_bt.record.footage import RECORD_SUFFIX, flight_record

SMALLEST_PX: Final = (224, 112)
"""Longer and shorter side of the smallest images."""

_VIDEO_SUFFIXES: Final = (
    *(".264", ".265", ".3gp", ".avi", ".h264", ".h265", ".hevc", ".m2ts", ".m4v", ".mkv"),
    *(".mov", ".mp4", ".mpg", ".mts", ".ts", ".webm"),
)
_KNOWN: Final = (*_VIDEO_SUFFIXES, *IMAGE_SUFFIXES, *FOREIGN_SUFFIXES, RECORD_SUFFIX)
_UNKNOWN_DURATION_S: Final = 60.0  # of a video that states none; it shares the images
_NAMED: Final = 3  # files that a message lists


@dataclass(frozen=True, kw_only=True)
class FrameSource:
    """A video file or a flight record, or a photograph."""

    name: str  # name in the list of images, different for each source
    path: Path  # the file
    content: str  # hash by which the file is known again, whatever its name
    video: ImageSource | None  # the images; None: the file is a photograph

    @property
    def seconds(self) -> float:
        """About how long it is."""
        stated_s = None if self.video is None else self.video.duration_s
        return _UNKNOWN_DURATION_S if stated_s is None else stated_s

    def gave(self, frame: LabFrame) -> bool:
        """Return whether a listed image was taken from this source."""
        return frame.content == self.content if frame.content else frame.source == self.name


def find_sources(
    paths: Sequence[Path], own: Path, listed: Sequence[LabFrame]
) -> tuple[list[FrameSource], list[FrameSource], list[str]]:
    """Find videos and records in the order of their names on the line, and photographs by name.

    Returns:
        Videos and records, photographs, and lines about files that are not read.
    """
    files: dict[str, Path] = {}  # by content: each file is read once
    foreign: list[Path] = []
    for path in paths:
        for file in _files(path, own):
            if file.suffix.lower() in FOREIGN_SUFFIXES:
                foreign.append(file)
            else:
                files.setdefault(fingerprint(file, dated=False), file)
    notes = []
    if foreign:
        names = ", ".join(map(str, foreign[:_NAMED]))
        more = f" and {len(foreign) - _NAMED} more" if len(foreign) > _NAMED else ""
        advice = "a format that is not read; convert photographs to JPEG or PNG"
        notes.append(f"{names}{more}: {advice}")
        if not files:
            raise InputError(notes[0])
    known = {frame.content: frame.source for frame in listed if frame.content}
    taken = set(known.values())
    filmed, photographs = [], []
    for content, file in files.items():
        name = known.get(content) or next(one for one in _names(file) if one not in taken)
        taken.add(name)
        if is_photograph(file):
            photographs.append(FrameSource(name=name, path=file, content=content, video=None))
        else:
            filmed.append(FrameSource(name=name, path=file, content=content, video=_opened(file)))
    return filmed, sorted(photographs, key=lambda one: one.name), notes


def is_photograph(path: Path) -> bool:
    """Return whether a file's name is that of an image."""
    return path.suffix.lower() in IMAGE_SUFFIXES


def check_size(path: Path, size_px: tuple[int, int]) -> None:
    """Refuse images that are too small to learn from."""
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
    found = [
        file
        for file in sorted(path.rglob("*"))
        if file.suffix.lower() in _KNOWN
        and not file.name.startswith(".")  # macOS puts ._NAME beside each file of a memory card
        and file.is_file()
        and own.resolve() not in file.resolve().parents
    ]
    if not found:
        raise FileError(path, "the folder holds no video, flight record or photograph")
    return found


def _names(file: Path) -> Iterator[str]:
    """Yield names for a file: the file name, then with the folder, as cameras repeat names."""
    # Names that are not UTF-8 cannot be written to a list.
    own, parent = (
        text.encode("utf-8", "replace").decode() for text in (file.name, file.resolve().parent.name)
    )
    yield own
    yield f"{parent}/{own}"
    for number in range(2, 1_000_000):
        yield f"{parent}-{number}/{own}"


def _opened(path: Path) -> ImageSource:
    """Open a video or record, and look at its first image."""
    recorded = path.suffix.lower() == RECORD_SUFFIX
    video: ImageSource = RecordSource(flight_record(path)) if recorded else VideoSource(path)
    with closing(video.images()) as images:
        first = next(images, None)
    if first is None:
        why = f" ({video.skipped[0]})" if video.skipped else ""
        raise FileError(path, f"holds no image that can be read{why}; film or copy it again")
    check_size(path, first.size_px)
    video.skipped.clear()  # of this look
    return video
