"""Checks of a picks file, before a teacher is trained on it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from typing import Final

import numpy as np

from perception.segmentation.teacher import fit_teacher
from perception.segmentation.training.pick_images import CHECK, HALF_SIZE, TRAIN, PickImages
from perception.segmentation.training.picks import Pick, read_numbered_picks
from uav_bt.errors import FileError, did_you_mean
from uav_bt.lab.classes import GROUND, LabClasses

FEW_PICKS: Final = 20  # a class with fewer is named
_FOLDS: Final = 5
_ALIKE_SHARE: Final = 0.2  # of the picks of two classes, each taken for the other
_LEAST_COMPARED: Final = 10  # picks of two classes


def check_picks(
    path: Path, folder: Path, classes: LabClasses, uses: Mapping[str, str]
) -> list[str]:
    """Check a picks file, and return warnings about it, a line each, without the file's name.

    Warned of are classes without picks or with few, classes that the check images do not show, and
    classes that look alike: of a teacher that did not learn from an image, the picks there of one
    class are often taken for the other. FileError for a misplaced pick (`placed_picks`), and if
    there are no picks to learn from of two classes or of the ground.
    """
    picks = placed_picks(path, folder, classes, uses)
    learned = [pick for pick in picks if uses[pick.image] == TRAIN]
    known, ground = {pick.class_id for pick in learned}, classes.of_role(GROUND)
    missing = ""
    if len(known) < 2:
        missing = f"two classes at least on images for training, got {len(known)}"
    elif not known.intersection(ground):
        names = ", ".join(f"'{classes.names[each]}'" for each in ground)
        missing = f"the ground ({names}) on images for training, got none"
    if missing:
        raise FileError(path, f"expected picks of {missing}: `uav-bt lab pick` adds some")
    return [
        *_few(learned, classes),
        *_unscored(picks, classes, uses),
        *_alike(learned, PickImages(folder, uses), classes),
    ]


def placed_picks(
    path: Path, folder: Path, classes: LabClasses, uses: Mapping[str, str]
) -> list[Pick]:
    """Read a picks file; a pick outside its image or on a missing image is refused by its line."""
    images = PickImages(folder, uses)
    picks = read_numbered_picks(path, classes)
    for line, pick in picks:
        if pick.image not in uses:
            wanted = f"on an image in {folder}"
            got = f"'{pick.image}'{did_you_mean(pick.image, uses)}"
        else:
            width, height = images.size_px(pick.image)
            if pick.x < width and pick.y < height:
                continue
            wanted = f"within the {width}x{height} pixels of '{pick.image}'"
            got = f"({pick.x}, {pick.y})"
        advice = "delete the line, or bring back the image that it was made on"
        raise FileError(path, f"expected a pick {wanted}, got {got}; {advice}", line=line)
    return [pick for _, pick in picks]


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


def _alike(learned: Sequence[Pick], images: PickImages, classes: LabClasses) -> Iterator[str]:
    ordered = sorted(learned, key=lambda pick: pick.image)
    patches = images.patches(ordered, classes)
    # Folds are by image, because picks of one image are alike.
    place = {name: number for number, name in enumerate(dict.fromkeys(p.image for p in ordered))}
    numbers = range(len(ordered)) if len(place) == 1 else [place[pick.image] for pick in ordered]
    folds = np.array(numbers) % _FOLDS
    taken = np.zeros((len(classes), len(classes)), dtype=np.int64)  # by class and by answer
    for fold in np.unique(folds).tolist():
        held = folds == fold
        if len(np.unique(patches.labels[~held])) < 2:
            continue
        rest = replace(patches, features=patches.features[~held], labels=patches.labels[~held])
        teacher = fit_teacher(rest, HALF_SIZE)
        scores = patches.features[held] @ teacher.weights.T + teacher.bias
        labels = patches.labels[held]
        known = np.isin(labels, teacher.known)  # the other folds may lack a class
        np.add.at(taken, (labels[known], scores.argmax(axis=1)[known]), 1)
    for one, other in combinations(range(len(classes)), 2):
        count = int(taken[one].sum() + taken[other].sum())
        share = (taken[one, other] + taken[other, one]) / max(count, 1)
        if count >= _LEAST_COMPARED and share >= _ALIKE_SHARE:
            yield (
                f"classes '{classes.names[one]}' and '{classes.names[other]}' look alike: "
                f"{100.0 * share:.0f} % of their picks are taken for the other; pick both in more "
                "images, or make one class of them"
            )
