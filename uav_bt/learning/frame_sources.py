"""Videos, flight records and photographs for a lab's images, and candidates from them.

A candidate is the sharpest image of each short time, kept as a JPEG file.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass
from itertools import compress, groupby
from pathlib import Path
from typing import Final, NamedTuple

import cv2

from perception.camera.image_files import FOREIGN_SUFFIXES, IMAGE_SUFFIXES, conversion_advice
from perception.segmentation.training.frame_choice import (
    Look,
    clear_ones,
    look_at,
    sharpness_size_px,
)
from uav_bt.app.sources.by_name import open_source
from uav_bt.app.sources.shots import ImageSource, Shot
from uav_bt.errors import FileError, InputError
from uav_bt.files import did_you_mean_file, writing
from uav_bt.learning.lab_material import fingerprint
from uav_bt.protocols import Advance, silent
from uav_bt.record.reader import RECORD_SUFFIX

_VIDEO_SUFFIXES: Final = (
    *(".264", ".265", ".3gp", ".avi", ".h264", ".h265", ".hevc", ".m2ts", ".m4v", ".mkv"),
    *(".mov", ".mp4", ".mpg", ".mts", ".ts", ".webm"),
)
_KNOWN: Final = (*_VIDEO_SUFFIXES, *IMAGE_SUFFIXES, *FOREIGN_SUFFIXES, RECORD_SUFFIX)
_UNKNOWN_DURATION_S: Final = 60.0  # of a video that states none; it shares the images


@dataclass(frozen=True, kw_only=True, eq=False)
class FrameSource:
    """A video file, a flight record or a photograph."""

    path: Path
    content: str  # hash by which the file is known again, whatever its name
    images: ImageSource

    @property
    def seconds(self) -> float:
        """About how long it is."""
        return (self.images.total or 0) / self.images.rate_per_s or _UNKNOWN_DURATION_S


def find_sources(
    paths: Sequence[Path], own: Path
) -> tuple[list[FrameSource], list[FrameSource], list[str]]:
    """Find videos and records in the order of the line, and photographs by name.

    Returns:
        Videos and records, photographs, and lines about files that are not read.
    """
    files = [file for path in paths for file in _files(path, own)]
    foreign = [file for file in files if file.suffix.lower() in FOREIGN_SUFFIXES]
    notes = [conversion_advice(foreign)] if foreign else []
    if foreign and foreign == files:
        raise InputError(notes[0])
    found: dict[str, FrameSource] = {}  # by content: each file is read once
    for file in files:
        if file not in foreign and (content := fingerprint(file)) not in found:
            images = open_source(str(file))
            found[content] = FrameSource(path=file, content=content, images=images)
    filmed = [one for one in found.values() if not is_photograph(one.path)]
    photographs = [one for one in found.values() if is_photograph(one.path)]
    return filmed, sorted(photographs, key=lambda one: one.path.name), notes


def is_photograph(path: Path) -> bool:
    """Return whether a file's name is that of an image."""
    return path.suffix.lower() in IMAGE_SUFFIXES


def _files(path: Path, own: Path) -> list[Path]:
    if not path.exists():
        raise FileError(
            path, f"there is no such video, photograph or folder{did_you_mean_file(path)}"
        )
    if own.resolve() in (path.resolve(), *path.resolve().parents):
        raise FileError(path, "is among the lab's own images: give the videos that they came from")
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


_WINDOW_S: Final = 0.5  # of which the sharpest image is a candidate
_MOST_CANDIDATES: Final = 1000  # of one video: their files take 0.3 to 1 MB each
_LONGEST_PX: Final = 1920
_SMALLEST_PX: Final = (224, 112)  # longer and shorter side of the smallest images
_JPEG_QUALITY: Final = 95


@dataclass(frozen=True, kw_only=True, eq=False)
class Candidate:
    """An image that may be chosen, with its measures."""

    source: FrameSource
    time_s: float
    look: Look
    file: Path  # not written if the image is blank


class Watched(NamedTuple):
    """Images of a video or of photographs, and how many were left out."""

    clear: list[Candidate]  # in the order of time, or of the photographs
    blurred: int  # candidates that were blurred or blank
    times_s: list[float]  # of all images that were read
    notes: list[str]


def watch(sources: Sequence[FrameSource], folder: Path, advance: Advance) -> Watched:
    """Keep the sharpest image of each half second of a video, or photographs that show something.

    FileError without any. One of several photographs that cannot be read is noted.
    """
    candidates: list[Candidate] = []
    times_s: list[float] = []
    notes: list[str] = []
    stills = is_photograph(sources[0].path)
    for number, source in enumerate(sources, start=1):
        try:
            candidates += _candidates(source, folder, times_s, silent if stills else advance)
            notes += [*source.images.warnings, *source.images.skipped]
        except FileError as error:
            if len(sources) == 1:
                raise
            notes.append(str(error))
        if stills:
            advance(f"photographs, {source.path.name}", number, len(sources))
    looks = [one.look for one in candidates]
    good = [not look.blank for look in looks] if stills else clear_ones(looks)
    clear = list(compress(candidates, good))
    if not clear:
        blank = sum(look.blank for look in looks)
        raise FileError(
            sources[0].path if len(sources) == 1 else sources[0].path.parent,
            f"none of its images can be used: {blank} are dark or of one colour, "
            f"{len(looks) - blank} are blurred; film slowly, in good light, with a clean lens"
            + "".join(f"; {note}" for note in notes),
        )
    return Watched(clear, len(candidates) - len(clear), times_s, notes)


def _candidates(
    source: FrameSource, folder: Path, times_s: list[float], advance: Advance
) -> list[Candidate]:
    """Return the candidates of a source in the order of time; add the times of all its images."""
    window_s = max(_WINDOW_S, source.seconds / _MOST_CANDIDATES)
    total_s = max(1, int(source.seconds))

    def measured(shots: Iterable[Shot]) -> Iterator[tuple[Look, Shot]]:
        for shot in shots:
            if max(shot.size_px) < _SMALLEST_PX[0] or min(shot.size_px) < _SMALLEST_PX[1]:
                raise FileError(
                    source.path,
                    f"the images must have at least {_SMALLEST_PX[0]}x{_SMALLEST_PX[1]} pixels, "
                    f"got {shot.size_px[0]}x{shot.size_px[1]}; take the camera's own file, not a "
                    "preview",
                )
            times_s.append(shot.time_s)
            advance(f"seconds of video, {source.path.name}", int(shot.time_s), total_s)
            yield look_at(shot.pixels(sharpness_size_px(*shot.size_px), colour=False)), shot

    candidates = []
    with closing(source.images.images()) as shots:
        windows = groupby(measured(shots), lambda one: int(one[1].time_s / window_s))
        for _, window in windows:
            # Of a video's images only the present window's best one is kept in memory.
            look, shot = min(window, key=lambda one: (one[0].blank, -one[0].sharpness))
            candidates.append(_candidate(source, look, shot, folder))
    if not candidates:
        why = f" ({source.images.skipped[0]})" if source.images.skipped else ""
        raise FileError(source.path, f"holds no image that can be read{why}; film or copy it again")
    return candidates


def _candidate(source: FrameSource, look: Look, shot: Shot, folder: Path) -> Candidate:
    """Write the file of a candidate unless it is blank."""
    file = folder / f"{source.content}-{shot.index}.jpg"
    if not look.blank:
        scale = min(1.0, _LONGEST_PX / max(shot.size_px))
        size_px = (max(1, round(shot.size_px[0] * scale)), max(1, round(shot.size_px[1] * scale)))
        bgr = cv2.cvtColor(shot.pixels(size_px), cv2.COLOR_RGB2BGR)
        _, encoded = cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])
        with writing(file):
            file.write_bytes(encoded.tobytes())
    return Candidate(source=source, time_s=shot.time_s, look=look, file=file)
