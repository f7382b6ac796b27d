"""Picks on the images of a lab: points, strokes and undo, each written to disk at once."""

from __future__ import annotations

import math
from collections import Counter, deque
from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Final

from perception.segmentation.training.next_image import CHECK, TRAIN, ImageChooser
from perception.segmentation.training.pick_images import PickImages
from perception.segmentation.training.picks import Pick, read_picks, write_picks
from uav_bt.errors import FileError, ValueRangeError
from uav_bt.files import reading, writing
from uav_bt.lab.classes import LabClasses

_MOST_UNDONE: Final = 200  # strokes

Point = tuple[int, int]  # x and y, pixels of the image


class PickSession:
    """The picks of a lab while a person makes them.

    Methods raise ValueRangeError for an image that is not on the list or a point outside it,
    UnknownNameError for an unknown class, and FileError where a file cannot be read or written.

    Args:
        folder: Folder of the images.
        picks_path: The picks file; existing picks are read.
        classes: Classes of the lab.
        uses: Use of each image (`train` or `check`), by file name.
    """

    def __init__(
        self, folder: Path, picks_path: Path, classes: LabClasses, uses: Mapping[str, str]
    ) -> None:
        self.images: Final = PickImages(folder, uses)
        self.classes: Final = classes
        self.path: Final = picks_path
        self.picks: list[Pick] = read_picks(picks_path, classes) if picks_path.exists() else []
        self._written = _content(picks_path)  # to notice the changes of another program
        self._strokes: deque[tuple[str, list[Pick]]] = deque(maxlen=_MOST_UNDONE)
        self.chooser: Final = ImageChooser(self.images, classes)

    def add(self, image: str, x: int, y: int, class_name: str) -> None:
        """Add a pick at a pixel."""
        class_id = self.classes.id_of(class_name)
        self._check(image, [(x, y)])
        self._replace(image, [*self.picks, Pick(image=image, x=x, y=y, class_id=class_id)])

    def paint(self, image: str, points: Sequence[Point], class_name: str) -> None:
        """Give every super-pixel under the points one pick of a class.

        It lies at the point of the stroke that is nearest to the innermost pixel, so that a stroke
        along a thin leg stays on it. Picks of other classes in these super-pixels are removed. One
        that has a pick of the class keeps it.
        """
        class_id = self.classes.id_of(class_name)
        regions = self._regions(image, points)
        found = self.images.super_pixels(image)
        kept, done = [], set()
        for pick in self.picks:
            region = found.at(pick.x, pick.y) if self._lies_on(pick, image) else None
            if region not in regions or pick.class_id == class_id:
                kept.append(pick)
                done.add(region)
        for region in regions:
            if region not in done:
                x, y = min(regions[region], key=partial(math.dist, found.innermost_of(region)))
                kept.append(Pick(image=image, x=x, y=y, class_id=class_id))
        self._replace(image, kept)

    def erase(self, image: str, points: Sequence[Point]) -> None:
        """Remove the picks in every super-pixel under the points; a single point removes one pick.

        That is the pick nearest to the point in its super-pixel.
        """
        regions = self._regions(image, points)
        found = self.images.super_pixels(image)
        hit = [
            pick
            for pick in self.picks
            if self._lies_on(pick, image) and found.at(pick.x, pick.y) in regions
        ]
        if len(points) == 1:
            hit = sorted(hit, key=lambda pick: math.dist(points[0], (pick.x, pick.y)))[:1]
        self._replace(image, [pick for pick in self.picks if pick not in hit])

    def undo(self) -> str | None:
        """Take back the last stroke of this session; return its image, None without a stroke."""
        if not self._strokes:
            return None
        image, before = self._strokes[-1]
        self._write(before)
        self._strokes.pop()
        return image

    def counts(self) -> dict[str, int]:
        """Return the number of picks of each class, by name."""
        counted = Counter(pick.class_id for pick in self.picks)
        return {name: counted[number] for number, name in enumerate(self.classes.names)}

    def picked_images(self) -> dict[str, int]:
        """Return the number of images with picks, by use."""
        uses = self.images.uses
        counted = Counter(uses.get(image) for image in {pick.image for pick in self.picks})
        return {TRAIN: counted[TRAIN], CHECK: counted[CHECK]}

    def _regions(self, image: str, points: Sequence[Point]) -> dict[int, list[Point]]:
        """Return the super-pixels under points with their points, in the order of the points."""
        self._check(image, points)
        found = self.images.super_pixels(image)
        regions: dict[int, list[Point]] = {}
        for x, y in points:
            regions.setdefault(found.at(x, y), []).append((x, y))
        return regions

    def _lies_on(self, pick: Pick, image: str) -> bool:
        """Return whether a pick lies within an image; a file may hold picks that lie outside."""
        width, height = self.images.size_px(image)
        return pick.image == image and pick.x < width and pick.y < height

    def _check(self, image: str, points: Iterable[Point]) -> None:
        width, height = self.images.size_px(image)
        for x, y in points:
            if not (0 <= x < width and 0 <= y < height):
                raise ValueRangeError(f"({x}, {y}) lies outside of {width}x{height} pixels")

    def _replace(self, image: str, picks: list[Pick]) -> None:
        if picks == self.picks:
            return
        before = self.picks
        self._write(picks)
        self._strokes.append((image, before))

    def _write(self, picks: list[Pick]) -> None:
        if _content(self.path) != self._written:
            raise FileError(
                self.path,
                "was changed by another program; nothing was written: end `uav-bt lab pick` and "
                "call it again",
            )
        if picks:
            write_picks(self.path, picks, self.classes)
        else:  # a picks file without picks is refused where it is read
            with writing(self.path):
                self.path.unlink(missing_ok=True)
        self._written = _content(self.path)
        self.picks = picks


def _content(path: Path) -> bytes:
    """Return the content of a picks file; empty without a file."""
    with reading(path):
        return path.read_bytes() if path.exists() else b""
