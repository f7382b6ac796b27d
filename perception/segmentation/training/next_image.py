"""The image to pick on next: the one in which the teacher of the present picks is least sure."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from perception.segmentation.features import hsv_of
from perception.segmentation.teacher import Teacher, fit_teacher
from perception.segmentation.training.pick_images import HALF_SIZE, PickImages
from perception.segmentation.training.picks import Pick
from uav_bt.errors import ValueRangeError
from uav_bt.lab.classes import LabClasses

TRAIN: Final = "train"
CHECK: Final = "check"
CHECK_SHARE: Final = 5  # at least one in five images with picks is for checks

_MOST_COMPARED: Final = 30  # images that the teacher is asked about: 40 ms each
_MOST_PICKS: Final = 500  # of a class, that the teacher is fitted on while a person waits
_STEP_PX: Final = 4  # distance of the compared pixels
_LOW_SHARE: Final = 0.2  # quantile of an image's margins


@dataclass(frozen=True, kw_only=True)
class NextImage:
    """An image to pick on, and why.

    Attributes:
        image: File name; None if every image has picks.
        reason: For the person who picks.
        margin: The image's `low_margin`; None if there is no teacher yet.
    """

    image: str | None
    reason: str
    margin: float | None = None


def wanted_use(picked_uses: Sequence[str]) -> str:
    """Return the use that the next image should have, so that one in five is for checks.

    The first four are for training, because the teacher learns from them.

    Args:
        picked_uses: Use of each image with picks.
    """
    total = len(picked_uses) + 1
    short = total >= CHECK_SHARE and CHECK_SHARE * picked_uses.count(CHECK) < total
    return CHECK if short else TRAIN


def low_margin(teacher: Teacher, rgb: NDArray[np.uint8]) -> float:
    """Return how unsure the teacher is in an image: low margins are unsure.

    A margin is the difference of the best and the second-best score of a pixel.

    Args:
        teacher: A teacher of two classes at least.
        rgb: (H, W, 3) uint8, at the teacher's size.

    Returns:
        The quantile at 20 % of the image's margins.
    """
    scores = np.stack(
        [plane[::_STEP_PX, ::_STEP_PX].copy() for _, plane in teacher.scores(hsv_of(rgb))]
    )
    scores.partition(len(scores) - 2, axis=0)
    return float(np.quantile(scores[-1] - scores[-2], _LOW_SHARE))


class ImageChooser:
    """Chooses images, and keeps the teacher until the picks change.

    Args:
        images: The images.
        classes: Classes of the lab.
    """

    def __init__(self, images: PickImages, classes: LabClasses) -> None:
        self._images, self._classes = images, classes
        self._passed: set[str] = set()  # images that were offered and have no pick
        self._teacher: tuple[tuple[Pick, ...], Teacher] | None = None
        self._lock = threading.Lock()

    def choose(self, picks: Sequence[Pick], after: str | None = None) -> NextImage:
        """Return the next image, of the use that is short of picks.

        Images that were offered before and have no pick come last.

        Args:
            picks: All picks.
            after: The image that is on the page.

        Raises:
            FileError: An image cannot be read.
        """
        with self._lock:
            return self._choose(picks, after)

    def _choose(self, picks: Sequence[Pick], after: str | None) -> NextImage:
        if after is not None:
            self._passed.add(after)
        uses, picked = self._images.uses, {pick.image for pick in picks}
        free = [name for name in uses if name not in picked and name != after]
        if not free:
            return NextImage(image=None, reason="every image has picks")
        if self._passed.issuperset(free):
            self._passed.clear()
        free = [name for name in free if name not in self._passed]
        use = wanted_use([uses[name] for name in uses if name in picked])
        free = [name for name in free if uses[name] == use] or free
        teacher = self._fitted(picks)
        if teacher is None:
            chosen = NextImage(image=self._farthest(free, picked), reason="far from the others")
        else:
            asked = free[:: -(-len(free) // _MOST_COMPARED)]
            margins = {name: low_margin(teacher, self._images.small(name)) for name in asked}
            least = min(asked, key=lambda name: margins[name])
            reason = f"the teacher is least sure of it, of {len(asked)}"
            chosen = NextImage(image=least, reason=reason, margin=margins[least])
        self._passed.add(str(chosen.image))
        return chosen

    def class_map(self, name: str, picks: Sequence[Pick]) -> NDArray[np.uint8]:
        """Return the teacher's present class map of an image, (324, 576) uint8 ids.

        Raises:
            ValueRangeError: The image is not on the list, or there are no picks of two classes.
            FileError: An image cannot be read.
        """
        with self._lock:
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
        uses = self._images.uses
        mine = tuple(pick for pick in picks if uses.get(pick.image) == TRAIN)
        if len({pick.class_id for pick in mine}) < 2:
            return None
        if self._teacher is None or self._teacher[0] != mine:
            patches = self._images.patches(_thinned(mine), self._classes)
            self._teacher = (mine, fit_teacher(patches, HALF_SIZE))
        return self._teacher[1]


def _thinned(picks: Sequence[Pick]) -> list[Pick]:
    """Return at most `_MOST_PICKS` picks of each class, spread evenly over them."""
    by_class: dict[int, list[Pick]] = {}
    for pick in picks:
        by_class.setdefault(pick.class_id, []).append(pick)
    return [pick for mine in by_class.values() for pick in mine[:: -(-len(mine) // _MOST_PICKS)]]
