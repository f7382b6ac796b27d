"""Picks on the images of a lab while a person makes them, and the image to pick on next.

Points, strokes and undo are written to disk at once. The next image is the one in which the teacher
of the present picks is least sure.
"""

from __future__ import annotations

import math
from collections import Counter, deque
from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Final

import numpy as np

from perception.segmentation.features import hsv_of
from perception.segmentation.teacher import Teacher, fit_teacher
from perception.segmentation.training.pick_images import CHECK, HALF_SIZE, TRAIN, PickImages
from perception.segmentation.training.picks import Pick, read_picks, write_picks
from uav_bt.errors import FileError, ValueRangeError
from uav_bt.files import reading, writing
from uav_bt.lab.classes import LabClasses
from uav_bt.types.arrays import Image

_MOST_UNDONE: Final = 200  # strokes
_CHECK_SHARE: Final = 5  # at least one in five images with picks is for checks
_MOST_COMPARED: Final = 30  # images that the teacher is asked about: 40 ms each
_MOST_PICKS: Final = 500  # of a class, that the teacher is fitted on while a person waits
_STEP_PX: Final = 4  # distance of the compared pixels
_LOW_SHARE: Final = 0.2  # quantile of an image's margins

Point = tuple[int, int]  # x and y, pixels of the image


class PickSession:
    """The picks of a lab while a person makes them.

    Existing picks are read. An image that is not on the list, a point outside it, an unknown class,
    and a file that cannot be read or written are refused.
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
        regions, found = self._regions(image, points), self.images.super_pixels(image)
        kept, done = [], set()
        for pick in self.picks:
            region = self._region_of(pick, image)
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
        hit = [pick for pick in self.picks if self._region_of(pick, image) in regions]
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
        return {use: counted[use] for use in (TRAIN, CHECK)}

    def _regions(self, image: str, points: Sequence[Point]) -> dict[int, list[Point]]:
        """Return the super-pixels under points with their points, in the order of the points."""
        self._check(image, points)
        found = self.images.super_pixels(image)
        regions: dict[int, list[Point]] = {}
        for x, y in points:
            regions.setdefault(found.at(x, y), []).append((x, y))
        return regions

    def _region_of(self, pick: Pick, image: str) -> int | None:
        """Return the super-pixel of a pick; None outside the image, where a file may have picks."""
        width, height = self.images.size_px(image)
        if pick.image != image or pick.x >= width or pick.y >= height:
            return None
        return self.images.super_pixels(image).at(pick.x, pick.y)

    def _check(self, image: str, points: Iterable[Point]) -> None:
        width, height = self.images.size_px(image)
        for x, y in points:
            if not (0 <= x < width and 0 <= y < height):
                raise ValueRangeError(f"({x}, {y}) lies outside of {width}x{height} pixels")

    def _replace(self, image: str, picks: list[Pick]) -> None:
        if picks != self.picks:
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
    with reading(path):
        return path.read_bytes() if path.exists() else b""


# --- the next image -------------------------------------------------------------------------------


def wanted_use(picked_uses: Sequence[str]) -> str:
    """Return the use that the next image should have, from the uses of the images with picks.

    One in five is for checks. The first four are for training: the teacher learns from them.
    """
    total = len(picked_uses) + 1
    short = total >= _CHECK_SHARE and _CHECK_SHARE * picked_uses.count(CHECK) < total
    return CHECK if short else TRAIN


def low_margin(teacher: Teacher, rgb: Image) -> float:
    """Return the quantile at 20 % of an image's margins; a teacher is unsure where it is low.

    A margin is the difference of the best and the second-best score of a pixel.
    """
    planes = (plane for _, plane in teacher.scores(hsv_of(rgb)))
    scores = np.stack([plane[::_STEP_PX, ::_STEP_PX].copy() for plane in planes])
    scores.partition(len(scores) - 2, axis=0)
    return float(np.quantile(scores[-1] - scores[-2], _LOW_SHARE))


class ImageChooser:
    """Chooses images, and keeps the teacher until the picks change; one thread at a time."""

    def __init__(self, images: PickImages, classes: LabClasses) -> None:
        self._images, self._classes = images, classes
        self._passed: set[str] = set()  # images that were offered and have no pick
        self._teacher: tuple[tuple[Pick, ...], Teacher] | None = None

    def choose(self, picks: Sequence[Pick], after: str | None = None) -> tuple[str | None, str]:
        """Return the next image, of the use that is short of picks, and why.

        Images that were offered before and have no pick come last; None if every image has picks.
        The page shows the image `after`.
        """
        if after is not None:
            self._passed.add(after)
        uses, picked = self._images.uses, {pick.image for pick in picks}
        free = [name for name in uses if name not in picked and name != after]
        if not free:
            return None, "every image has picks"
        if self._passed.issuperset(free):
            self._passed.clear()
        free = [name for name in free if name not in self._passed]
        use = wanted_use([uses[name] for name in uses if name in picked])
        free = [name for name in free if uses[name] == use] or free
        teacher = self._fitted(picks)
        if teacher is None:
            chosen, reason = self._farthest(free, picked), "far from the others"
        else:
            asked = free[:: -(-len(free) // _MOST_COMPARED)]
            margins = {name: low_margin(teacher, self._images.small(name)) for name in asked}
            chosen = min(asked, key=margins.__getitem__)
            reason = f"the teacher is least sure of it, of {len(asked)}"
        self._passed.add(chosen)
        return chosen, reason

    def class_map(self, name: str, picks: Sequence[Pick]) -> Image:
        """Return the teacher's present class map of an image, (324, 576) uint8 ids."""
        teacher = self._fitted(picks)
        if teacher is None:
            raise ValueRangeError(
                "the class map needs picks of two classes on images that the network learns from"
            )
        return teacher.window_ids(self._images.small(name))

    def _farthest(self, free: Sequence[str], picked: set[str]) -> str:
        """Return the free image that is farthest from all images that were picked or offered."""
        place = {name: number for number, name in enumerate(self._images.uses)}
        known = [place[name] for name in picked | self._passed if name in place]
        if not known:
            return free[0]
        return max(free, key=lambda name: min(abs(place[name] - other) for other in known))

    def _fitted(self, picks: Sequence[Pick]) -> Teacher | None:
        """Return a teacher of the picks that training learns from; None without two classes."""
        mine = tuple(pick for pick in picks if self._images.uses.get(pick.image) == TRAIN)
        if len({pick.class_id for pick in mine}) < 2:
            return None
        if self._teacher is None or self._teacher[0] != mine:
            by_class: dict[int, list[Pick]] = {}
            for pick in mine:
                by_class.setdefault(pick.class_id, []).append(pick)
            fitted = chain(*(some[:: -(-len(some) // _MOST_PICKS)] for some in by_class.values()))
            patches = self._images.patches(fitted, self._classes)
            self._teacher = mine, fit_teacher(patches, HALF_SIZE)
        return self._teacher[1]
