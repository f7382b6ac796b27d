"""Picks: points on images with a class, labelled by a person or simulated from the twin.

The file is CSV with the columns ``image,x,y,class,origin``: the image's file name, the pixel's
column and row in that image, a class name, and the origin (``hand`` or ``simulated``).
"""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal, cast, get_args

import numpy as np
from numpy.typing import NDArray

from perception.segmentation import features
from uav_bt.errors import FileError, ValueRangeError, did_you_mean
from uav_bt.files import did_you_mean_file, read_bounded, reading, write_whole
from uav_bt.lab.classes import LabClasses
from uav_bt.types.arrays import Flags, Floats, Image

Origin = Literal["hand", "simulated"]
_MAX_BYTES: Final = 50_000_000  # a pick takes about 50
_COLUMNS: Final = ("image", "x", "y", "class", "origin")
_IMAGES_PER_CLASS: Final = (7, 9)  # least and most in a scene; the paper's
_PURITY: Final = 0.9  # share of the class in a drawn patch


@dataclass(frozen=True, kw_only=True)
class Pick:
    """A pixel of an image and its class."""

    image: str  # the image's file name, without a folder
    x: int  # column, pixels of that image
    y: int  # row
    class_id: int
    origin: Origin = "hand"  # marks simulated picks

    def __post_init__(self) -> None:
        if self.x < 0 or self.y < 0:
            raise ValueRangeError(f"a pick must not be negative, got ({self.x}, {self.y})")
        if not self.image or Path(self.image).name != self.image:
            raise ValueRangeError(f"a pick names a file without a folder, got '{self.image}'")


# --- files ----------------------------------------------------------------------------------------


def write_picks(path: Path, picks: Iterable[Pick], classes: LabClasses) -> None:
    """Write picks as CSV with the names of classes; the file is replaced in one step."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(_COLUMNS)
    for pick in picks:
        writer.writerow([pick.image, pick.x, pick.y, classes.names[pick.class_id], pick.origin])
    write_whole(path, text.getvalue())


def read_picks(path: Path, classes: LabClasses) -> list[Pick]:
    """Read a picks file; a malformed one is refused with its line."""
    return [pick for _, pick in read_numbered_picks(path, classes)]


def read_numbered_picks(path: Path, classes: LabClasses) -> list[tuple[int, Pick]]:
    """Read a picks file; each pick comes with its line number."""
    with reading(path):
        if not path.exists():
            raise FileError(path, f"there is no such picks file{did_you_mean_file(path)}")
        text = read_bounded(path, _MAX_BYTES).decode("utf-8-sig")
    reader = csv.reader(io.StringIO(text))
    try:
        rows = [(reader.line_num, row) for row in reader if row]
    except csv.Error as error:
        raise FileError(path, f"no CSV: {error}", line=reader.line_num) from error
    if rows and tuple(rows[0][1]) != _COLUMNS:
        raise FileError(path, f"the columns must be {','.join(_COLUMNS)}", line=1)
    picks = list[tuple[int, Pick]]()
    for line, row in rows[1:]:
        try:
            picks.append((line, _parse(row, classes.names)))
        except ValueRangeError as error:
            raise FileError(path, str(error), line=line) from error
    if not picks:
        raise FileError(path, "holds no picks; a picks file needs a header and at least one row")
    return picks


def _parse(row: Sequence[str], names: Sequence[str]) -> Pick:
    if len(row) != len(_COLUMNS):
        raise ValueRangeError(f"expected {len(_COLUMNS)} columns, got {len(row)}")
    image, x, y, name, origin = row
    if name not in names:
        raise ValueRangeError(f"unknown class '{name}'{did_you_mean(name, names)}")
    if origin not in get_args(Origin):
        raise ValueRangeError(f"origin must be 'hand' or 'simulated', got '{origin}'")
    try:
        column, line = int(x), int(y)
    except ValueError as error:
        raise ValueRangeError(f"x and y must be whole pixels, got '{x}', '{y}'") from error
    class_id = names.index(name)
    return Pick(image=image, x=column, y=line, class_id=class_id, origin=cast("Origin", origin))


# --- picks to features ----------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class PickedPatches:
    """Features and colours of the patches around picks: the teacher's training data."""

    features: Floats  # (N, 190) histograms, `features`
    labels: NDArray[np.int64]  # (N,) class ids
    colour_counts: NDArray[np.int64]  # (C, 32768) pixels by class and coarse colour, `palette`
    classes: LabClasses  # the C classes of the lab


def gather_patches(
    picks: Iterable[Pick], images: Iterable[tuple[str, Image]], patch_px: int, classes: LabClasses
) -> PickedPatches:
    """Return features and colours of the patches around all picks, in the images' order.

    The images come with their file names; only one of them is in memory at a time.

    Raises:
        ValueRangeError: An image with picks is not among them.
    """
    by_image: dict[str, list[Pick]] = {}
    for pick in picks:
        by_image.setdefault(pick.image, []).append(pick)
    rows, labels = list[Floats](), list[int]()
    colour_counts = np.zeros((len(classes), features.COLOUR_COUNT), dtype=np.int64)
    for name, rgb in images:
        if not (mine := by_image.pop(name, [])):
            continue
        points = np.array([(pick.x, pick.y) for pick in mine], dtype=np.int64)
        rows.append(features.patch_features(features.hsv_of(rgb), points, patch_px))
        height, width = rgb.shape[:2]
        for pick in mine:
            labels.append(pick.class_id)
            x, y = pick.x, pick.y
            patch = features.patch_slices(x, y, patch_px=patch_px, width_px=width, height_px=height)
            codes = features.colour_codes(rgb[patch]).ravel()
            colour_counts[pick.class_id] += np.bincount(codes, minlength=features.COLOUR_COUNT)
    if by_image:
        raise ValueRangeError(f"picks on {', '.join(by_image)}, which is not among the images")
    return PickedPatches(np.concatenate(rows), np.array(labels), colour_counts, classes)


# --- simulated picks ------------------------------------------------------------------------------


def draw_picks(
    samples: Iterable[tuple[str, Image]],
    rng: np.random.Generator,
    *,
    patch_px: int,
    total: int = 6500,
) -> list[Pick]:
    """Sample picks from exact class ids well inside each class, like a person's clicks.

    For each class, images of one scene (name and exact ids) are chosen among those that show it
    well, and points among the pixels with the purest patches. The paper took 7 to 9 images per
    class in each scene and 6,484 points in total.
    """
    # By class: image, largest share of the class in a patch, and (N, 2) x, y of such patches.
    sites: dict[int, list[tuple[str, float, NDArray[np.int64]]]] = {}
    for name, ids in samples:
        for class_id in np.unique(ids).tolist():
            site = name, *_purest(ids == class_id, rng, patch_px)
            sites.setdefault(class_id, []).append(site)
    picks: list[Pick] = []
    for class_id in sorted(sites):
        wanted = int(rng.integers(_IMAGES_PER_CLASS[0], _IMAGES_PER_CLASS[1] + 1))
        # All images that reach the purity are equally good, so that distances and angles vary.
        order = rng.permutation(len(sites[class_id]))
        ranked = sorted(order, key=lambda i: -min(sites[class_id][i][1], _PURITY))
        chosen = [sites[class_id][i] for i in ranked[:wanted]]
        share = -(-total // (len(sites) * len(chosen)))
        for name, _, points in chosen:
            picks.extend(
                Pick(image=name, x=x, y=y, class_id=class_id, origin="simulated")
                for x, y in rng.permutation(points)[:share].tolist()
            )
    return picks


def _purest(
    mask: Flags, rng: np.random.Generator, patch_px: int
) -> tuple[float, NDArray[np.int64]]:
    """Return the largest share of a class in a patch, and points with about this share."""
    means = features.WindowMeans(width_px=mask.shape[1], height_px=mask.shape[0], side_px=patch_px)
    share = features.spread_to_border(means.of(mask.astype(np.float64)), patch_px)
    share[~mask] = 0.0  # a person clicks on the object
    best = float(share.max())
    points = np.argwhere(share >= min(_PURITY, 0.95 * best))[:, ::-1].astype(np.int64)
    # A few hundred points are enough; whole masks of every image would fill the memory.
    return best, rng.permutation(points)[:500]
