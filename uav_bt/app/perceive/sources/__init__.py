"""Pictures from a video file, a folder or a live camera, one after another."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from uav_bt.app.perceive.sources.camera import CAMERA, CameraSource
from uav_bt.app.perceive.sources.images import PICTURE_SUFFIXES, FolderSource, RecordSource
from uav_bt.app.perceive.sources.picture import Picture, Pictures, PictureSource
from uav_bt.app.perceive.sources.video import VideoSource
from uav_bt.clock import WallClock
from uav_bt.errors import FileError, InputError
from uav_bt.protocols import Clock

__all__ = [
    "PICTURE_SUFFIXES",
    "CameraSource",
    "FolderSource",
    "Picture",
    "PictureSource",
    "Pictures",
    "RecordSource",
    "VideoSource",
    "open_source",
]


def open_source(
    text: str, *, clock: Clock | None = None, times_s: Sequence[float] | None = None
) -> PictureSource:
    """Return the source that a text names; opens nothing that has to be closed.

    Args:
        text: a video file, a folder of pictures, a picture, or `camera:N`.
        clock: tells a live camera's times; default: the clock on the wall.
        times_s: of a folder's pictures, in their order; default: ten a second.

    Raises:
        FileError: there is no such file or folder, or it holds no pictures.
        InputError: the camera's number is none.
        ShapeError: the folder holds another number of pictures than there are times.
    """
    if text.startswith(CAMERA):
        number = text.removeprefix(CAMERA)
        if not re.fullmatch(r"\d{1,3}", number):
            raise InputError(f"expected a camera such as camera:0, got '{text}'")
        return CameraSource(int(number), clock or WallClock())
    path = Path(text)
    if path.is_dir():
        return FolderSource(path, times_s=times_s)
    if not path.is_file():
        raise FileError(
            path, "there is no such video file or folder of pictures (a live camera is camera:0)"
        )
    if path.suffix.lower() in PICTURE_SUFFIXES:
        return FolderSource(path, times_s=times_s)
    return VideoSource(path)
