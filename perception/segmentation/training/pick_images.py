"""The images that a person picks on: shrunk for the teacher, and divided into super-pixels."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Final, TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.camera.image_files import read_image
from perception.segmentation.teacher import TeacherConfig
from perception.segmentation.training.picks import Pick, PickedPatches, gather_patches
from perception.segmentation.training.super_pixels import SuperPixels, find_super_pixels
from uav_bt.errors import ValueRangeError
from uav_bt.lab.classes import LabClasses

HALF_SIZE: Final = TeacherConfig(width_px=576, height_px=324, patch_px=20)
"""The teacher at half of its size: a person waits for it."""

_MOST_DIVIDED: Final = 8  # images whose super-pixels are kept: 3 MB each
_MOST_SMALL: Final = 128  # images of half size that are kept: 0.6 MB each

_Kept = TypeVar("_Kept")


class PickImages:
    """The images of a folder, and a cache of patches and super-pixels of the last ones.

    Args:
        folder: Folder of the images.
        uses: Use of each image (`train` or `check`), by file name in the order of the list.
    """

    def __init__(self, folder: Path, uses: Mapping[str, str]) -> None:
        self.folder: Final = folder
        self.uses: Final = dict(uses)
        self._sizes_px: dict[str, tuple[int, int]] = {}
        self._divided: OrderedDict[str, SuperPixels] = OrderedDict()
        self._small: OrderedDict[str, NDArray[np.uint8]] = OrderedDict()
        self._lock = threading.RLock()  # a server answers several requests at a time

    def file(self, name: str) -> Path:
        """Return the file of a listed image.

        Raises:
            ValueRangeError: The name is not on the list. Files outside the folder are not opened.
        """
        if name not in self.uses:
            raise ValueRangeError(f"there is no image '{name}'")
        return self.folder / name

    def size_px(self, name: str) -> tuple[int, int]:
        """Return width and height of an image.

        Raises:
            ValueRangeError: The name is not on the list.
            FileError: The image cannot be read.
        """
        if name not in self._sizes_px:
            self.small(name)
        return self._sizes_px[name]

    def super_pixels(self, name: str) -> SuperPixels:
        """Return the super-pixels of an image.

        Raises:
            ValueRangeError: The name is not on the list.
            FileError: The image cannot be read.
        """
        with self._lock:
            return _kept(
                self._divided, name, _MOST_DIVIDED, lambda: find_super_pixels(self._read(name))
            )

    def small(self, name: str) -> NDArray[np.uint8]:
        """Return an image at `HALF_SIZE`, (324, 576, 3) RGB uint8.

        Raises:
            ValueRangeError: The name is not on the list.
            FileError: The image cannot be read.
        """
        size = (HALF_SIZE.width_px, HALF_SIZE.height_px)

        def shrink() -> NDArray[np.uint8]:
            resized = cv2.resize(self._read(name), size, interpolation=cv2.INTER_AREA)
            return np.asarray(resized, dtype=np.uint8)

        with self._lock:
            return _kept(self._small, name, _MOST_SMALL, shrink)

    def patches(self, picks: Iterable[Pick], classes: LabClasses) -> PickedPatches:
        """Return features and colours around picks, at `HALF_SIZE`.

        Args:
            picks: Picks on listed images.
            classes: Classes of the lab.

        Raises:
            ValueRangeError: There is no pick, or one lies on no listed image or outside its image.
            FileError: An image cannot be read.
        """
        scaled = []
        for pick in picks:
            width, height = self.size_px(pick.image)
            x, y = pick.x * HALF_SIZE.width_px // width, pick.y * HALF_SIZE.height_px // height
            scaled.append(replace(pick, x=x, y=y))
        names = dict.fromkeys(pick.image for pick in scaled)
        return gather_patches(scaled, self._smalls(names), HALF_SIZE.patch_px, classes)

    def _smalls(self, names: Iterable[str]) -> Iterator[tuple[str, NDArray[np.uint8]]]:
        for name in names:
            yield name, self.small(name)

    def _read(self, name: str) -> NDArray[np.uint8]:
        # With the EXIF orientation, as browsers and training have it.
        rgb = read_image(self.file(name), colour=True, as_stored=False)
        self._sizes_px[name] = (rgb.shape[1], rgb.shape[0])
        return rgb


def _kept(store: OrderedDict[str, _Kept], name: str, most: int, make: Callable[[], _Kept]) -> _Kept:
    """Return the entry of a name; the entry that was used longest ago is removed."""
    if name not in store:
        store[name] = make()
        if len(store) > most:
            store.popitem(last=False)
    store.move_to_end(name)
    return store[name]
