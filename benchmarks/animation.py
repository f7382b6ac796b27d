"""Animated WebP files of films, for pages."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import av
import cv2
import numpy as np

from uav_bt.types.arrays import Image


def unchanged(image: Image) -> Image:
    """Return the image."""
    return image


def film_seconds(film: Path) -> float:
    """Return the length of a film, seconds."""
    with av.open(str(film)) as container:
        return float((container.duration or 0) / av.time_base)


def images_of(
    film: Path, every_s: float, width_px: int, part: Callable[[Image], Image] = unchanged
) -> list[Image]:
    """Return images of a film, one for each step of time.

    Args:
        film: the film's file.
        every_s: the step, seconds.
        width_px: width of the images, pixels; the height keeps the proportions.
        part: returns the part of an image (HxWx3, uint8, BGR) that is kept.
    """
    images: list[Image] = []
    with av.open(str(film)) as container:
        for one in container.decode(video=0):
            if (one.time or 0.0) >= every_s * len(images):
                image = part(np.asarray(one.to_ndarray(format="bgr24"), dtype=np.uint8))
                height_px = round(image.shape[0] * width_px / image.shape[1])
                small = cv2.resize(image, (width_px, height_px), interpolation=cv2.INTER_AREA)
                images.append(np.asarray(small, dtype=np.uint8))
    return images


def write_animation(
    images: Sequence[Image], shown_ms: int, out: Path, *, quality: int = 40
) -> None:
    """Write an animated WebP.

    Args:
        images: the images, each HxWx3, uint8, BGR, all of one size.
        shown_ms: time that each image is shown, milliseconds.
        out: the file.
        quality: of the compression, 1 to 100.
    """
    animation = cv2.Animation()
    animation.frames = list(images)
    animation.durations = [shown_ms] * len(images)
    cv2.imwriteanimation(str(out), animation, [cv2.IMWRITE_WEBP_QUALITY, quality])


def write_animation_within(
    images: Sequence[Image], shown_ms: int, out: Path, limit_bytes: int
) -> None:
    """Write an animated WebP in the best quality of at most a number of bytes.

    Args:
        images: the images, each HxWx3, uint8, BGR, all of one size.
        shown_ms: time that each image is shown, milliseconds.
        out: the file.
        limit_bytes: largest size of the file.

    Raises:
        ValueError: the file is larger in the least quality, too.
    """
    for quality in (60, 50, 40, 30, 20, 10):
        write_animation(images, shown_ms, out, quality=quality)
        if out.stat().st_size <= limit_bytes:
            return
    raise ValueError(f"{out} is larger than {limit_bytes} bytes: use fewer or smaller images")
