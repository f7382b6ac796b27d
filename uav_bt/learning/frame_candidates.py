"""Candidates for a lab's images: the sharpest image of each short time, kept as a JPEG file."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import cv2

from perception.segmentation.training.frame_choice import (
    Look,
    clear_ones,
    look_at,
    sharpness_size_px,
)
from uav_bt.app.sources.by_name import FolderSource
from uav_bt.app.sources.shots import Shot
from uav_bt.errors import FileError
from uav_bt.files import writing
from uav_bt.learning.frame_sources import FrameSource, check_size

_WINDOW_S: Final = 0.5  # of which the sharpest image is a candidate
_MOST_CANDIDATES: Final = 1000  # of one video: their files take 0.3 to 1 MB each
_LONGEST_PX: Final = 1920
_JPEG_QUALITY: Final = 95


@dataclass(frozen=True, kw_only=True, eq=False)
class Candidate:
    """An image that may be chosen: its source, time in s, measures, and file unless it is blank."""

    source: FrameSource
    time_s: float
    look: Look
    file: Path | None


def watch(
    filmed: FrameSource, folder: Path, on_time: Callable[[float], None]
) -> tuple[list[Candidate], int, float]:
    """Read a video and keep the sharpest image of each half second, longer in very long videos.

    Returns:
        The candidates in order of time, the number of images that were read, the last one's time.
    """
    if filmed.video is None:
        raise ValueError(filmed.name)
    window_s = max(_WINDOW_S, filmed.seconds / _MOST_CANDIDATES)
    candidates: list[Candidate] = []
    best: tuple[Look, Shot] | None = None
    read, window, end_s = 0, 0, 0.0
    with closing(filmed.video.images()) as shots:
        for shot in shots:
            now = int(shot.time_s / window_s)
            if best is not None and now != window:
                candidates.append(_candidate(filmed, *best, folder / f"{len(candidates):05d}.jpg"))
                best = None
            window, read, end_s = now, read + 1, shot.time_s
            look = look_at(shot.shrunk(sharpness_size_px(*shot.size_px), colour=False))
            # Of a video's images only the present window's best one is kept in memory.
            if best is None or (look.blank, -look.sharpness) < (best[0].blank, -best[0].sharpness):
                best = look, shot
            on_time(end_s)
    if best is not None:
        candidates.append(_candidate(filmed, *best, folder / f"{len(candidates):05d}.jpg"))
    return candidates, read, end_s


def look_at_photograph(photograph: FrameSource, file: Path) -> Candidate:
    """Read a photograph, turned as its EXIF data say; FileError if it is none, or too small."""
    source = FolderSource(photograph.path)
    shot = next(source.images(), None)
    if shot is None:
        raise FileError(photograph.path, source.skipped[0].partition(": ")[2])
    check_size(photograph.path, shot.size_px)
    look = look_at(shot.shrunk(sharpness_size_px(*shot.size_px), colour=False))
    return _candidate(photograph, look, shot, file)


def _candidate(source: FrameSource, look: Look, shot: Shot, file: Path) -> Candidate:
    """Write the file of a candidate unless it is blank."""
    if look.blank:
        return Candidate(source=source, time_s=shot.time_s, look=look, file=None)
    scale = min(1.0, _LONGEST_PX / max(shot.size_px))
    size_px = (max(1, round(shot.size_px[0] * scale)), max(1, round(shot.size_px[1] * scale)))
    bgr = cv2.cvtColor(shot.shrunk(size_px, colour=True), cv2.COLOR_RGB2BGR)
    whole, encoded = cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])
    if not whole:
        raise FileError(file, "the image cannot be written as JPEG")
    with writing(file):
        file.write_bytes(encoded.tobytes())
    return Candidate(source=source, time_s=shot.time_s, look=look, file=file)


def clear_candidates(candidates: Sequence[Candidate], path: Path) -> list[Candidate]:
    """Return the candidates that are neither blank nor blurred; FileError without any."""
    looks = [one.look for one in candidates]
    clear = [one for one, good in zip(candidates, clear_ones(looks), strict=True) if good]
    if not clear:
        blank = sum(look.blank for look in looks)
        raise FileError(
            path,
            f"none of its images can be used: {blank} are dark or of one colour, "
            f"{len(looks) - blank} are blurred; film slowly, in good light, with a clean lens",
        )
    return clear
