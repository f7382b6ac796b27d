"""The image to pick on next: the one in which the teacher of the present picks is least sure."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from perception.segmentation.features import hsv_of
from perception.segmentation.teacher import Teacher, fit_teacher
from perception.segmentation.training.pick_images import HALF_SIZE, PickImages
from perception.segmentation.training.picks import Pick
from uav_bt.errors import ValueRangeError
from uav_bt.lab.classes import LabClasses
from uav_bt.types.arrays import Image

TRAIN: Final = "train"
CHECK: Final = "check"

_CHECK_SHARE: Final = 5  # at least one in five images with picks is for checks
_MOST_COMPARED: Final = 30  # images that the teacher is asked about: 40 ms each
_MOST_PICKS: Final = 500  # of a class, that the teacher is fitted on while a person waits
_STEP_PX: Final = 4  # distance of the compared pixels
_LOW_SHARE: Final = 0.2  # quantile of an image's margins


def wanted_use(picked_uses: Sequence[str]) -> str:
    """Return the use that the next image should have, from the uses of the images with picks.

    One in five is for checks. The first four are for training: the teacher learns from them.
    """
    total = len(picked_uses) + 1
    short = total >= _CHECK_SHARE and _CHECK_SHARE * picked_uses.count(CHECK) < total
    return CHECK if short else TRAIN


def low_margin(teacher: Teacher, rgb: Image) -> float:
    """Return how unsure a teacher is in an image of its size: low margins are unsure.

    A margin is the difference of the best and the second-best score of a pixel; returned is the
    quantile at 20 % of the image's margins.
    """
    scores = np.stack(
        [plane[::_STEP_PX, ::_STEP_PX].copy() for _, plane in teacher.scores(hsv_of(rgb))]
    )
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

        Args:
            picks: All picks.
            after: The image that is on the page.
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

    def class_map(self, name: str, picks: Sequence[Pick]) -> NDArray[np.uint8]:
        """Return the teacher's present class map of an image, (324, 576) uint8 ids.

        Raises:
            ValueRangeError: The image is not on the list, or there are no picks of two classes.
        """
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
        by_class: dict[int, list[Pick]] = {}
        for pick in mine:
            by_class.setdefault(pick.class_id, []).append(pick)
        if len(by_class) < 2:
            return None
        if self._teacher is None or self._teacher[0] != mine:
            fitted = [
                pick for some in by_class.values() for pick in some[:: -(-len(some) // _MOST_PICKS)]
            ]
            patches = self._images.patches(fitted, self._classes)
            self._teacher = mine, fit_teacher(patches, HALF_SIZE)
        return self._teacher[1]
