"""The images that a person picks on, and checks of the picks before a teacher is trained on them.

Super-pixels are small regions whose borders follow the edges of objects. A watershed from a regular
grid of markers gives them (Machairas et al., Waterpixels, IEEE Trans. Image Process. 2015), because
OpenCV has SLIC only in its contributed modules.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import combinations, pairwise, product
from pathlib import Path
from typing import Final, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from perception.camera.image_files import read_image
from perception.segmentation.teacher import TeacherConfig, fit_teacher
from perception.segmentation.training.picks import (
    Pick,
    PickedPatches,
    gather_patches,
    read_numbered_picks,
)
from uav_bt.errors import FileError, ValueRangeError, did_you_mean
from uav_bt.lab.classes import GROUND, LabClasses
from uav_bt.protocols import Advance, silent
from uav_bt.types.arrays import Image

# The teacher at half of its size: a person waits for it.
HALF_SIZE: Final = TeacherConfig(width_px=576, height_px=324, patch_px=20)
TRAIN: Final = "train"  # uses of images
CHECK: Final = "check"
MAX_WIDTH_PX: Final = 1152  # wider images are shrunk to it
_SIDE_SHARE: Final = 40.0 / MAX_WIDTH_PX  # side of a region in widths of the image
_MIN_SIDE_PX: Final = 4
_BLUR_PX: Final = 1.5  # standard deviation at the full width; noise makes ragged borders
_MOST_SMALL: Final = 128  # shrunk images in memory, at half size 0.6 MB each
_MOST_DIVIDED: Final = 8  # divided ones, 3 MB each
FEW_PICKS: Final = 20  # a class with fewer is named
_FOLDS: Final = 5
_ALIKE_SHARE: Final = 0.2  # of the picks of two classes, each taken for the other
_LEAST_COMPARED: Final = 10  # picks of two classes


class SuperPixels(NamedTuple):
    """The super-pixels of an image."""

    ids: NDArray[np.int32]  # (h, w) region of each pixel of the shrunk image, 0 to N - 1
    # (N, 2) x and y of the pixel of each region that is farthest from its border, shrunk image
    innermost: NDArray[np.int64]
    size_px: tuple[int, int]  # width and height of the image

    def at(self, x: int, y: int) -> int:
        """Return the region of a pixel of the image."""
        height, width = self.ids.shape
        column = int((x + 0.5) * width / self.size_px[0])
        row = int((y + 0.5) * height / self.size_px[1])
        return int(self.ids[row, column])

    def innermost_of(self, region: int) -> tuple[int, int]:
        """Return x and y of a region's innermost pixel, in the image."""
        height, width = self.ids.shape
        x, y = (self.innermost[region] + 0.5).tolist()
        return int(x * self.size_px[0] / width), int(y * self.size_px[1] / height)


class PickImages:
    """The images of a folder, with the use of each (`TRAIN` or `CHECK`) by file name, in order.

    `config` has the size of the shrunk ones and of patches on them.
    """

    def __init__(
        self, folder: Path, uses: Mapping[str, str], config: TeacherConfig = HALF_SIZE
    ) -> None:
        self.folder, self.uses, self.config = folder, dict(uses), config
        self._sizes_px: dict[str, tuple[int, int]] = {}
        self.small = lru_cache(_MOST_SMALL)(self._shrunk)
        self.super_pixels = lru_cache(_MOST_DIVIDED)(
            lambda name: find_super_pixels(self._read(name))
        )

    def file(self, name: str) -> Path:
        """Return the file of a listed image; others, outside the folder too, are not opened."""
        if name not in self.uses:
            raise ValueRangeError(f"there is no image '{name}'")
        return self.folder / name

    def size_px(self, name: str) -> tuple[int, int]:
        """Return width and height of an image."""
        if name not in self._sizes_px:
            self._read(name)
        return self._sizes_px[name]

    def patches(
        self, picks: Iterable[Pick], classes: LabClasses, advance: Advance = silent
    ) -> PickedPatches:
        """Return features and colours around picks on listed images."""
        scaled, config = [], self.config
        for pick in picks:
            width, height = self.size_px(pick.image)
            x, y = pick.x * config.width_px // width, pick.y * config.height_px // height
            scaled.append(replace(pick, x=x, y=y))
        names = dict.fromkeys(pick.image for pick in scaled)

        def images() -> Iterator[tuple[str, Image]]:
            for done, name in enumerate(names, start=1):
                yield name, self.small(name)
                advance("patches", done, len(names))

        return gather_patches(scaled, images(), config.patch_px, classes)

    def _shrunk(self, name: str) -> Image:
        size = (self.config.width_px, self.config.height_px)
        resized = cv2.resize(self._read(name), size, interpolation=cv2.INTER_AREA)
        return np.asarray(resized, dtype=np.uint8)

    def _read(self, name: str) -> Image:
        # With the EXIF orientation, as browsers and training have it.
        rgb = read_image(self.file(name), colour=True, as_stored=False)
        self._sizes_px[name] = (rgb.shape[1], rgb.shape[0])
        return rgb


def find_super_pixels(rgb: Image) -> SuperPixels:
    """Divide an image, (H, W, 3), into super-pixels of about 40 pixels at a width of 1152."""
    height, width = rgb.shape[:2]
    small = rgb
    if width > MAX_WIDTH_PX:
        size = (MAX_WIDTH_PX, max(1, round(height * MAX_WIDTH_PX / width)))
        small = np.asarray(cv2.resize(rgb, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)
    sigma = max(0.5, _BLUR_PX * small.shape[1] / MAX_WIDTH_PX)
    smooth = np.asarray(cv2.GaussianBlur(small, (0, 0), sigma), dtype=np.uint8)
    side = max(_MIN_SIDE_PX, round(_SIDE_SHARE * small.shape[1]))
    ids = _flooded(smooth, _markers(smooth, side))
    return SuperPixels(ids, _innermost(ids), (width, height))


def _markers(smooth: Image, side: int) -> NDArray[np.int32]:
    """Return (h, w) marks from 1 on: one in the middle half of each cell of the grid."""
    kernel = np.ones((3, 3), dtype=np.uint8)
    gradient = cv2.morphologyEx(smooth, cv2.MORPH_GRADIENT, kernel).max(axis=2)
    markers = np.zeros(gradient.shape, dtype=np.int32)
    cells = product(*(_cells(length, side) for length in gradient.shape))
    for number, ((top, bottom), (left, right)) in enumerate(cells, start=1):
        window = gradient[top:bottom, left:right]
        row, column = np.unravel_index(int(window.argmin()), window.shape)
        markers[top + row, left + column] = number
    return markers


def _cells(length: int, side: int) -> list[tuple[int, int]]:
    """Return begin and end of the middle half of each cell along an axis."""
    edges = np.linspace(0, length, max(1, round(length / side)) + 1)
    found = []
    for begin, end in pairwise(edges.tolist()):
        first = int(begin + 0.25 * (end - begin))
        found.append((first, max(first + 1, int(end - 0.25 * (end - begin)))))
    return found


def _flooded(smooth: Image, markers: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return the region of every pixel, from 0 on."""
    # The watershed marks the image's frame as border, too: a frame of one pixel is added.
    wide = cv2.copyMakeBorder(smooth, 1, 1, 1, 1, cv2.BORDER_REPLICATE)
    flooded = np.pad(markers, 1)
    cv2.watershed(wide, flooded)
    regions = flooded[1:-1, 1:-1].astype(np.float32)  # of float, because int32 is not dilated
    kernel = np.ones((3, 3), dtype=np.uint8)
    while (lines := regions < 1.0).any():
        regions[lines] = cv2.dilate(regions, kernel)[lines]
    return np.asarray(regions, dtype=np.int32) - 1


def _innermost(ids: NDArray[np.int32]) -> NDArray[np.int64]:
    """Return (N, 2) x and y of the pixel of each region with the largest distance to its border."""
    wide = np.pad(ids, 1, constant_values=-1)
    around = (wide[:-2, 1:-1], wide[2:, 1:-1], wide[1:-1, :-2], wide[1:-1, 2:])
    inside = np.all([neighbour == ids for neighbour in around], axis=0)
    distance = cv2.distanceTransform(inside.astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    places = ndimage.maximum_position(distance, ids, np.arange(int(ids.max()) + 1))
    return np.array([(column, row) for row, column in places], dtype=np.int64)


# --- checks of picks ------------------------------------------------------------------------------


def check_picks(
    path: Path, folder: Path, classes: LabClasses, uses: Mapping[str, str]
) -> list[str]:
    """Check a picks file, and return warnings about it, a line each, without the file's name.

    Classes look alike if a teacher that did not learn from an image often takes the picks there of
    one for the other. FileError for a misplaced pick (`placed_picks`), and if there are no picks to
    learn from of two classes or of the ground.
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
