"""Scores of a segmentation on the picks of images that it did not learn from."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np

from perception.camera.image_files import read_image
from perception.networks.weights_file import segmentation_file
from perception.segmentation.evaluation import SegmentationScore, confusion
from perception.segmentation.runtime import OnnxSegmenter
from perception.segmentation.training.picks import Pick
from uav_bt.errors import InputError
from uav_bt.files import write_whole
from uav_bt.lab.classes import LabClasses
from uav_bt.lab.lab import Lab
from uav_bt.lab.shipped import lab_address
from uav_bt.protocols import Advance, silent
from uav_bt.types.arrays import Image

Segment = Callable[[Image], Image]
"""Returns class ids, (h, w), of an image, (H, W, 3) RGB."""

_PANE_PX: Final = 320  # width of an image of the sheet
_SHEET_ROWS: Final = 8
_CONFUSIONS: Final = 5  # that are named
_LEAST_CONFUSION: Final = 0.02  # share of a class's picks that a line is worth; chosen
_RIGHT: Final = (255, 255, 255)
_WRONG: Final = (255, 0, 0)


@dataclass(frozen=True, kw_only=True, eq=False)
class ImageScore:
    """Picks of one image and the classes that a segmentation gives there."""

    image: str  # file name
    picks: Sequence[Pick]  # its picks
    answers: Image  # class ids at the picks, (N,) uint8
    wrong: int  # number of picks with another class


@dataclass(frozen=True, kw_only=True)
class PickScore:
    """Score of a segmentation on picks; each pick is a sample."""

    total: SegmentationScore  # counts by class, and the scores of them
    images: Sequence[ImageScore]  # scores of the images, most wrong picks first

    @property
    def picks(self) -> dict[str, int]:
        """Number of picks of each class, by name."""
        counts = self.total.counts.sum(axis=1).tolist()
        return dict(zip(self.total.classes.names, counts, strict=True))

    @property
    def unchecked(self) -> list[str]:
        """Names of the classes without a pick."""
        return [name for name, count in self.picks.items() if not count]

    @property
    def min_role_iou(self) -> float:
        """Lowest intersection over union of the roles with picks."""
        return float(np.nanmin(self.total.role_iou))

    def confusions(self) -> list[tuple[str, str, float]]:
        """Return the largest confusions: class, taken class, share of its picks."""
        counts, names = self.total.counts, self.total.classes.names
        share = counts / np.maximum(counts.sum(axis=1, keepdims=True), 1)
        np.fill_diagonal(share, 0.0)
        largest = np.argsort(-share, axis=None, kind="stable")[:_CONFUSIONS]
        pairs = zip(*np.unravel_index(largest, share.shape), strict=True)
        return [
            (names[true], names[taken], float(share[true, taken]))
            for true, taken in pairs
            if share[true, taken] >= _LEAST_CONFUSION
        ]

    def to_json(self) -> dict[str, Any]:
        """Return the scores as JSON values; None for a class or role without picks."""
        return {
            **self.total.to_json(),
            "picks": self.picks,
            "confusions": [list(each) for each in self.confusions()],
            "unchecked": self.unchecked,
            "worst_images": {each.image: each.wrong for each in self.images if each.wrong},
        }


def network_of_lab(lab: Lab, model: Path | None = None) -> OnnxSegmenter:
    """Return the segmentation network of a lab."""
    if model is not None:
        return OnnxSegmenter(model, lab.classes)
    stated = lab.network.get("model")
    file = None if stated is None else segmentation_file(stated)
    if file is None:
        raise InputError(
            f"the lab '{lab.name}' has no network: `uav-bt lab train {lab_address(lab)}` makes one"
        )
    return OnnxSegmenter(file, lab.classes, lab.network.get("classes"))


def score_picks(
    segment: Segment,
    picks: Sequence[Pick],
    frames: Path,
    classes: LabClasses,
    *,
    advance: Advance = silent,
) -> PickScore:
    """Score a segmentation at picks, which are in pixels of the images of a folder."""
    if not picks:
        raise InputError(
            f"there are no picks on images for checks in {frames}: pick on images whose use is "
            "'check' in frames.csv"
        )
    by_image: dict[str, list[Pick]] = {}
    for pick in picks:
        by_image.setdefault(pick.image, []).append(pick)
    counts = np.zeros((len(classes), len(classes)), dtype=np.int64)
    scores = []
    for done, (name, mine) in enumerate(by_image.items(), start=1):
        rgb = read_image(frames / name, colour=True, as_stored=False)
        ids, (down, across) = segment(rgb), rgb.shape[:2]
        height, width = ids.shape
        rows = [pick.y * height // down for pick in mine]
        answers = ids[rows, [pick.x * width // across for pick in mine]].astype(np.uint8)
        exact = np.array([pick.class_id for pick in mine], dtype=np.uint8)
        counts += confusion(answers, exact, len(classes))
        wrong = int((answers != exact).sum())
        scores.append(ImageScore(image=name, picks=mine, answers=answers, wrong=wrong))
        advance("check", done, len(by_image))
    scores.sort(key=lambda each: (-each.wrong, each.image))
    total = SegmentationScore(counts=counts, images=len(scores), classes=classes)
    return PickScore(total=total, images=scores)


def write_sheet(score: PickScore, segment: Segment, frames: Path, file: Path) -> None:
    """Write the worst images as a PNG file: image, class map, and image with its picks.

    A pick is a disc of the colour of its class, with a white rim, or a red one if the segmentation
    has another class there.
    """
    worst, classes = score.images[:_SHEET_ROWS], score.total.classes
    strips = [_strip(each, segment, frames, classes) for each in worst]
    _, png = cv2.imencode(".png", cv2.cvtColor(np.vstack(strips), cv2.COLOR_RGB2BGR))
    file.parent.mkdir(parents=True, exist_ok=True)
    write_whole(file, png.tobytes())


def _strip(each: ImageScore, segment: Segment, frames: Path, classes: LabClasses) -> Image:
    rgb = read_image(frames / each.image, colour=True, as_stored=False)
    height, width = rgb.shape[:2]
    size = (_PANE_PX, max(round(_PANE_PX * height / width), 1))
    small = cv2.resize(rgb, size, interpolation=cv2.INTER_AREA)
    ids = cv2.resize(segment(rgb), size, interpolation=cv2.INTER_NEAREST_EXACT)
    marked = small.copy()
    for pick, answer in zip(each.picks, each.answers, strict=True):
        at = (pick.x * size[0] // width, pick.y * size[1] // height)
        right = int(answer) == pick.class_id
        cv2.circle(marked, at, 5, _RIGHT if right else _WRONG, -1, cv2.LINE_AA)
        colour = tuple(map(int, classes.colours[pick.class_id]))
        cv2.circle(marked, at, 3, colour, -1, cv2.LINE_AA)
    panes = [small, classes.colourise(np.asarray(ids, dtype=np.uint8)), marked]
    return np.asarray(np.hstack(panes), dtype=np.uint8)
