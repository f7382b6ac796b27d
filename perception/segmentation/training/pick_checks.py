"""Checks of a picks file, before a teacher is trained on it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from perception.segmentation.teacher import fit_teacher
from perception.segmentation.training.next_image import CHECK, TRAIN
from perception.segmentation.training.pick_images import HALF_SIZE, PickImages
from perception.segmentation.training.picks import Pick, PickedPatches, read_numbered_picks
from uav_bt.errors import FileError, did_you_mean
from uav_bt.lab.classes import GROUND, LabClasses

FEW_PICKS: Final = 20  # a class with fewer is named
_FOLDS: Final = 5
_ALIKE_SHARE: Final = 0.2  # of the picks of two classes, each taken for the other
_LEAST_COMPARED: Final = 10  # picks of two classes


def check_picks(
    picks_path: Path, folder: Path, classes: LabClasses, uses: Mapping[str, str]
) -> list[str]:
    """Check a picks file, and return warnings about it.

    Warned of are classes without picks or with few, classes that the check images do not show, and
    classes that look alike: of a teacher that did not learn from an image, the picks there of one
    class are often taken for the other.

    Args:
        picks_path: The picks file.
        folder: Folder of the images.
        classes: Classes of the lab.
        uses: Use of each image (`train` or `check`), by file name.

    Returns:
        Warnings, a line each, without the file's name.

    Raises:
        FileError: A pick lies outside its image or on an image that is not there, or there are no
            picks to learn from of two classes or of the ground. The message names the line where
            there is one.
    """
    picks = placed_picks(picks_path, folder, classes, uses)
    images = PickImages(folder, uses)
    learned = [pick for pick in picks if uses[pick.image] == TRAIN]
    _check_enough(learned, picks_path, classes)
    return [
        *_few(learned, classes),
        *_unscored(picks, classes, uses),
        *_alike(learned, images, classes),
    ]


def placed_picks(
    picks_path: Path, folder: Path, classes: LabClasses, uses: Mapping[str, str]
) -> list[Pick]:
    """Read a picks file whose picks lie inside their images.

    Args:
        picks_path: The picks file.
        folder: Folder of the images.
        classes: Classes of the lab.
        uses: Use of each image (`train` or `check`), by file name.

    Raises:
        FileError: The file is malformed, or a pick lies outside its image or on an image that is
            not there. The message names the line.
    """
    images = PickImages(folder, uses)
    picks = []
    for line, pick in read_numbered_picks(picks_path, classes):
        _check_place(pick, images, picks_path, line)
        picks.append(pick)
    return picks


def _check_place(pick: Pick, images: PickImages, path: Path, line: int) -> None:
    if pick.image not in images.uses:
        raise FileError(
            path,
            f"expected a pick on an image in {images.folder}, got '{pick.image}'"
            f"{did_you_mean(pick.image, images.uses)}; bring the image back, or delete the line",
            line=line,
        )
    width, height = images.size_px(pick.image)
    if pick.x >= width or pick.y >= height:
        raise FileError(
            path,
            f"expected a pick within the {width}x{height} pixels of '{pick.image}', got "
            f"({pick.x}, {pick.y}); delete the line, or bring back the image that it was made on",
            line=line,
        )


def _check_enough(learned: Sequence[Pick], path: Path, classes: LabClasses) -> None:
    known = {pick.class_id for pick in learned}
    if len(known) < 2:
        raise FileError(
            path,
            f"expected picks of two classes at least on images for training, got {len(known)}: "
            "`uav-bt lab pick` adds some",
        )
    ground = classes.of_role(GROUND)
    if not known.intersection(ground):
        names = ", ".join(f"'{classes.names[each]}'" for each in ground)
        raise FileError(
            path,
            f"expected picks of the ground ({names}) on images for training, got none: "
            "`uav-bt lab pick` adds some",
        )


def _few(learned: Sequence[Pick], classes: LabClasses) -> Iterator[str]:
    counts = Counter(pick.class_id for pick in learned)
    for number, name in enumerate(classes.names):
        if counts[number] == 0:
            yield f"class '{name}' has no picks on images for training: it is never predicted"
        elif counts[number] < FEW_PICKS:
            yield (
                f"class '{name}' has only {counts[number]} picks on images for training: "
                f"{FEW_PICKS} or more are better"
            )


def _unscored(picks: Sequence[Pick], classes: LabClasses, uses: Mapping[str, str]) -> Iterator[str]:
    learned = {pick.class_id for pick in picks if uses[pick.image] == TRAIN}
    scored = {pick.class_id for pick in picks if uses[pick.image] == CHECK}
    if not scored:
        yield "no image for the check has picks: the network cannot be scored"
    elif unscored := sorted(learned - scored):
        names = ", ".join(f"'{classes.names[each]}'" for each in unscored)
        yield f"no image for the check has picks of {names}: they cannot be scored"


# --- classes that look alike ----------------------------------------------------------------------


def _alike(learned: Sequence[Pick], images: PickImages, classes: LabClasses) -> Iterator[str]:
    ordered = sorted(learned, key=lambda pick: pick.image)
    patches = images.patches(ordered, classes)
    taken = _taken_for(patches, _folds(ordered))
    for one, other in combinations(range(len(classes)), 2):
        count = int(taken[one].sum() + taken[other].sum())
        share = (taken[one, other] + taken[other, one]) / max(count, 1)
        if count >= _LEAST_COMPARED and share >= _ALIKE_SHARE:
            yield (
                f"classes '{classes.names[one]}' and '{classes.names[other]}' look alike: "
                f"{100.0 * share:.0f} % of their picks are taken for the other; pick both in more "
                "images, or make one class of them"
            )


def _folds(ordered: Sequence[Pick]) -> NDArray[np.int64]:
    """Return the fold of each pick: by image, because picks of one image are alike."""
    names = sorted({pick.image for pick in ordered})
    if len(names) == 1:
        return np.arange(len(ordered)) % _FOLDS
    place = {name: number % _FOLDS for number, name in enumerate(names)}
    return np.array([place[pick.image] for pick in ordered], dtype=np.int64)


def _taken_for(patches: PickedPatches, folds: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return (C, C) numbers of picks by their class and by the class that they were taken for.

    Picks of a class that the other folds do not have are left out.
    """
    taken = np.zeros((len(patches.classes), len(patches.classes)), dtype=np.int64)
    for fold in np.unique(folds).tolist():
        held = folds == fold
        if len(np.unique(patches.labels[~held])) < 2:
            continue
        rest = replace(patches, features=patches.features[~held], labels=patches.labels[~held])
        teacher = fit_teacher(rest, HALF_SIZE)
        scores = patches.features[held] @ teacher.weights.T + teacher.bias
        labels = patches.labels[held]
        known = np.isin(labels, teacher.known)
        np.add.at(taken, (labels[known], scores.argmax(axis=1)[known]), 1)
    return taken
