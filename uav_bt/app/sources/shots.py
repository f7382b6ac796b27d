"""What every source of images gives: images in order of time, converted on demand."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Generator
from dataclasses import dataclass
from functools import partial
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.camera.image_files import UPRIGHT, Orientation
from uav_bt.types.arrays import Image

RATE: Final = 10.0  # images a second where it is unknown: a mission's tick

Size = tuple[int, int]
"""Width and height in pixels."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Shot:
    """One image of a source."""

    index: int  # counts all images of the source, also those that are left out
    time_s: float  # since the source began
    name: str  # for messages
    size_px: Size  # as it is shown
    orientation: Orientation = UPRIGHT  # from the stored image to the shown one
    pixels: Callable[..., NDArray[np.uint8]]
    """Returns the image as it is shown, (H, W, 3) uint8 RGB.

    Arguments: `size_px`, None for the whole image, and `colour`; without it (H, W) uint8 grey.
    """

    @classmethod
    def of(cls, image: Image, **about: Any) -> Shot:
        """Return the shot of an image that is an array already, (H, W, 3) RGB."""
        size_px = (image.shape[1], image.shape[0])
        return cls(size_px=size_px, pixels=partial(_resized, image), **about)


Shots = Generator[Shot, None, None]
"""Images in order of time; closing lets go of the file or the camera."""


class ImageSource(ABC):
    """Gives images in order of time.

    Attributes:
        name: its name in messages.
        total: how many images it has; None where it is unknown.
        rate_per_s: how many images a second, about.
        skipped: images that were skipped so far, with the reasons.
        warnings: what may be wrong with all of them.
    """

    def __init__(self, name: str, total: int | None, rate_per_s: float = RATE) -> None:
        self.name = name
        self.total = total
        self.rate_per_s = rate_per_s
        self.skipped: list[str] = []
        self.warnings: list[str] = []

    @abstractmethod
    def images(self, every: int = 1) -> Shots:
        """Iterate over every n-th image. Unreadable images are skipped and reported."""


def _resized(
    image: Image, size_px: Size | None = None, *, colour: bool = True
) -> NDArray[np.uint8]:
    array = image if colour else cv2.cvtColor(image, cv2.COLOR_RGB2GRAY)
    if size_px is None:
        return np.asarray(array, dtype=np.uint8)
    shrinks = size_px[0] < image.shape[1]
    interpolation = cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR
    return np.asarray(cv2.resize(array, size_px, interpolation=interpolation), dtype=np.uint8)
