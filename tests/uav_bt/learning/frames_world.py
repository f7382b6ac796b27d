"""A drawn wall filmed by a camera that moves along it, for the tests of `lab frames`."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from functools import cache
from pathlib import Path

import av
import cv2
import numpy as np
from av.stream import Disposition

from uav_bt.types.arrays import Image

SIZE = (256, 144)


@cache
def _wall() -> Image:
    random = np.random.default_rng(4)
    wall = np.full((SIZE[1], 40 * SIZE[0], 3), 128, np.uint8)
    for _ in range(2400):
        x, y = int(random.integers(0, wall.shape[1])), int(random.integers(0, wall.shape[0]))
        width, height = (int(side) for side in random.integers(8, 50, 2))
        colour = tuple(int(level) for level in random.integers(0, 255, 3))
        cv2.rectangle(wall, (x, y), (x + width, y + height), colour, -1)
    return wall


def view(place: float) -> Image:
    """Return a view of the wall, (144, 256, 3) RGB; `place` counts widths of the view."""
    left = round(place * SIZE[0])
    return _wall()[:, left : left + SIZE[0]].copy()


def blurred(image: Image, sigma_px: float = 4.0) -> Image:
    return np.asarray(cv2.GaussianBlur(image, (0, 0), sigma_px), dtype=np.uint8)


def walk(count: int = 10, begin: float = 0.0) -> list[Image]:
    """Return sharp views, each half a width beside the last one."""
    return [view(begin + 0.5 * number) for number in range(count)]


def write_video(
    path: Path,
    images: Sequence[Image],
    *,
    codec: str = "libx264",
    rate: int = 2,
    times_s: Sequence[float] | None = None,
    cover: Image | None = None,
) -> Path:
    """Write a video, by default of `rate` images a second; a cover picture precedes them."""
    path.parent.mkdir(parents=True, exist_ok=True)
    times_s = times_s or [number / rate for number in range(len(images))]
    with av.open(str(path), "w") as container:
        if cover is not None:
            picture = container.add_stream("mjpeg", rate=1)
            picture.height, picture.width = cover.shape[:2]
            picture.pix_fmt = "yuvj420p"
            picture.disposition = Disposition.attached_pic
        stream = container.add_stream(codec, rate=rate)
        stream.height, stream.width = images[0].shape[:2]
        stream.pix_fmt, stream.bit_rate = "yuv420p", 4_000_000
        stream.options = {"preset": "ultrafast", "x265-params": "log-level=none"}
        stream.codec_context.time_base = Fraction(1, 1000)
        if cover is not None:
            container.mux(picture.encode(av.VideoFrame.from_ndarray(cover, format="rgb24")))
        for image, time_s in zip(images, times_s, strict=True):
            frame = av.VideoFrame.from_ndarray(image, format="rgb24")
            frame.pts, frame.time_base = round(1000 * time_s), Fraction(1, 1000)
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    return path


def write_photograph(path: Path, image: Image) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    assert cv2.imwrite(str(path), image[..., ::-1])
    return path
