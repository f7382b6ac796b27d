"""Candidates for a lab's images: the sharpest image of each short time, kept as a JPEG file."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import cv2

from perception.camera.image_files import read_image
from perception.segmentation.training.frame_choice import Look, look_at, sharpness_size_px
from uav_bt.errors import FileError
from uav_bt.files import writing
from uav_bt.learning.frame_sources import Filmed, Photograph, Shot, WholeShot, check_size

_WINDOW_S: Final = 0.5
_MOST_CANDIDATES: Final = 1000  # of one video: their files take 0.3 to 1 MB each
_LONGEST_PX: Final = 1920
_JPEG_QUALITY: Final = 95


@dataclass(frozen=True, kw_only=True, eq=False)
class Candidate:
    """An image that may be chosen.

    Attributes:
        source: Name of the video or photograph.
        time_s: Time in the video, s; 0 for a photograph.
        look: Its measures.
        file: The JPEG file; None if the image is blank.
    """

    source: str
    time_s: float
    look: Look
    file: Path | None


@dataclass(frozen=True, kw_only=True)
class Watched:
    """A video that was read to its end.

    Attributes:
        candidates: In order of time.
        read: How many images were read.
        end_s: Time of the last one.
    """

    candidates: tuple[Candidate, ...]
    read: int
    end_s: float


def watch(filmed: Filmed, folder: Path, on_time: Callable[[float], None]) -> Watched:
    """Read a video and keep the sharpest image of each half second, longer in very long videos.

    Args:
        filmed: The video or record.
        folder: For the files of the candidates.
        on_time: Called with the time of each image, s.

    Raises:
        FileError: The video cannot be read, or a file cannot be written.
    """
    window_s = max(_WINDOW_S, filmed.duration_s / _MOST_CANDIDATES)
    candidates: list[Candidate] = []
    best: tuple[Look, Shot] | None = None
    read, window, end_s = 0, 0, 0.0

    def keep(look: Look, shot: Shot) -> None:
        file = None if look.blank else folder / f"{len(candidates):05d}.jpg"
        if file is not None:
            _write(shot, file)
        candidates.append(Candidate(source=filmed.name, time_s=shot.time_s, look=look, file=file))

    with closing(filmed.shots()) as shots:
        for shot in shots:
            now = int(shot.time_s / window_s)
            if best is not None and now != window:
                keep(*best)
                best = None
            window, read, end_s = now, read + 1, shot.time_s
            look = look_at(shot.shrunk(sharpness_size_px(*shot.size_px), colour=False))
            # Of a video's images only the present window's best one is kept in memory.
            if best is None or (look.blank, -look.sharpness) < (
                best[0].blank,
                -best[0].sharpness,
            ):
                best = look, shot
            on_time(end_s)
    if best is not None:
        keep(*best)
    return Watched(candidates=tuple(candidates), read=read, end_s=end_s)


def look_at_photograph(photograph: Photograph, file: Path) -> Candidate:
    """Read a photograph, turned as its EXIF data says.

    Args:
        photograph: The photograph.
        file: For the candidate.

    Raises:
        FileError: It cannot be read or is too small, or the file cannot be written.
    """
    shot = WholeShot(array=read_image(photograph.path, colour=True, as_stored=False))
    check_size(photograph.path, shot.size_px)
    look = look_at(shot.shrunk(sharpness_size_px(*shot.size_px), colour=False))
    if not look.blank:
        _write(shot, file)
    return Candidate(
        source=photograph.name, time_s=0.0, look=look, file=None if look.blank else file
    )


def _write(shot: Shot, file: Path) -> None:
    width_px, height_px = shot.size_px
    scale = min(1.0, _LONGEST_PX / max(width_px, height_px))
    size_px = (max(1, round(width_px * scale)), max(1, round(height_px * scale)))
    bgr = cv2.cvtColor(shot.shrunk(size_px, colour=True), cv2.COLOR_RGB2BGR)
    whole, encoded = cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])
    if not whole:
        raise FileError(file, "the image cannot be written as JPEG")
    with writing(file):
        file.write_bytes(encoded.tobytes())
