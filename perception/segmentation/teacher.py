"""The teacher: a one-vs-rest linear SVM on colour histograms of image windows.

Mocanu et al. (arXiv 2510.16624) classify a grid of 40x40-pixel patches. A linear model on the
histograms of a patch is a sum over the patch's pixels, and each pixel contributes the weights of
its three bins. So one table look-up and one box sum give the score of a class for *every* window,
equal to scikit-learn's ``decision_function`` on that patch.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Final

import cv2
import numpy as np

from perception.networks.weights_file import read_weights, write_weights
from perception.segmentation import clean, features
from perception.segmentation.training.picks import PickedPatches
from uav_bt.errors import ValueRangeError, WeightsError
from uav_bt.lab.classes import GROUND, OBSTACLE, OUTSIDE, LabClasses
from uav_bt.types.arrays import Floats, Floats32, Ids, Image

_KIND: Final = "hsv-histogram-svm"


@dataclass(frozen=True, kw_only=True)
class TeacherConfig:
    """Settings of the teacher; the defaults are the paper's where it gives them."""

    width_px: int = 1152  # size of the shrunk images: 30 % of 4K (3840x2160)
    height_px: int = 648
    patch_px: int = 40  # side of a patch at that size
    cost: float = 0.1  # the SVM's C; not in the paper, chosen on the validation scenes
    max_iterations: int = 20000  # of liblinear, far more than needed

    def __post_init__(self) -> None:
        if not 1 <= self.patch_px <= min(self.width_px, self.height_px):
            raise ValueRangeError(
                f"a patch of {self.patch_px} pixels does not fit {self.width_px}x{self.height_px}"
            )


@dataclass(frozen=True, eq=False)
class Teacher:
    """The trained linear model: a score for each class is ``weights @ features + bias``."""

    classes: LabClasses  # C classes
    weights: Floats  # (C, 190)
    bias: Floats  # (C,); -inf for a class without picks, so that it never wins
    palette: Floats32  # (C, 32768), `features.palette_of_counts`
    config: TeacherConfig

    @property
    def known(self) -> tuple[int, ...]:
        """Ids of the classes with picks."""
        return tuple(np.flatnonzero(np.isfinite(self.bias)).tolist())

    def resized(self, rgb: Image) -> Image:
        """Return the image at the teacher's size (area interpolation when it shrinks)."""
        size = (self.config.width_px, self.config.height_px)
        interpolation = cv2.INTER_AREA if rgb.shape[1] >= size[0] else cv2.INTER_LINEAR
        return np.asarray(cv2.resize(rgb, size, interpolation=interpolation), dtype=np.uint8)

    def scores(self, hsv: Image) -> Iterator[tuple[int, Floats]]:
        """Yield id and score of the window around every pixel, (H, W), of the classes with picks.

        Windows near the border are shifted inwards (`features.patch_slices`).
        """
        for class_id, inner in self._window_scores(hsv):
            yield class_id, features.spread_to_border(inner, self.config.patch_px)

    def window_ids(self, rgb: Image) -> Ids:
        """Return the best class, (H, W), of the window around every pixel of a resized image."""
        scores = self._window_scores(features.hsv_of(rgb))
        first, inner = next(scores)
        best = inner.copy()
        ids = np.full(best.shape, first, dtype=np.uint8)
        for class_id, inner in scores:
            np.putmask(ids, inner > best, np.uint8(class_id))
            np.maximum(best, inner, out=best)
        return features.spread_to_border(ids, self.config.patch_px)

    def paper_ids(self, rgb: Image) -> Ids:
        """Return the class map of a resized image: dots, dilation, largest components."""
        dots = clean.dilated_grid(self.window_ids(rgb))
        scattered = self.classes.of_role(OUTSIDE) + self.classes.of_role(GROUND)
        return clean.keep_largest_components(dots, scattered)

    def refined_ids(self, rgb: Image) -> Ids:
        """Return the class map of a resized image: sharp borders, no holes in sides of boxes."""
        ids = clean.sharpened(self.window_ids(rgb), rgb, self.palette)
        ids = clean.drop_small_components(ids, area_px=clean.SMALLEST_PX)
        # The top of the mark inside its sides is not a hole, nor are objects before the ground.
        sides, but = self.classes.of_role(OBSTACLE), (self.classes.mark_top,)
        return clean.filled_holes(ids, inside=sides, but=but, area_px=clean.HOLE_PX)

    def _window_scores(self, hsv: Image) -> Iterator[tuple[int, Floats]]:
        """Yield the scores of all whole windows; each array is valid until the next one."""
        height_px, width_px = hsv.shape[:2]
        means = features.WindowMeans(
            width_px=width_px, height_px=height_px, side_px=self.config.patch_px
        )
        planes = cv2.split(hsv)
        pixel, part = np.empty((height_px, width_px)), np.empty((height_px, width_px))
        for class_id in self.known:
            # A pixel of a patch adds the weights of its three bins. OpenCV needs contiguous copies.
            hue, saturation, value = self.weights[class_id][features.BIN_OF_LEVEL].T.copy()
            cv2.LUT(planes[0], hue, pixel)
            cv2.add(pixel, cv2.LUT(planes[1], saturation, part), pixel)
            cv2.add(pixel, cv2.LUT(planes[2], value, part), pixel)
            scores = means.of(pixel)
            np.add(scores, self.bias[class_id], out=scores)
            yield class_id, scores


def fit_teacher(patches: PickedPatches, config: TeacherConfig, *, seed: int = 0) -> Teacher:
    """Train the one-vs-rest linear SVM and count the palette; classes without a pick never win.

    The seed is that of liblinear's coordinate order.
    """
    # Imported here because scikit-learn is slow to import and only training needs it.
    from sklearn.multiclass import OneVsRestClassifier  # noqa: PLC0415
    from sklearn.svm import LinearSVC  # noqa: PLC0415

    present = np.unique(patches.labels)
    if len(present) < 2:
        raise ValueRangeError(f"a teacher needs picks of two classes at least, got {len(present)}")
    svm = LinearSVC(C=config.cost, max_iter=config.max_iterations, random_state=seed)
    model = OneVsRestClassifier(svm).fit(patches.features, patches.labels)
    slopes = np.concatenate([machine.coef_ for machine in model.estimators_])
    offsets = np.concatenate([machine.intercept_ for machine in model.estimators_])
    if len(present) == 2:  # scikit-learn keeps one machine, whose positive side is the second class
        slopes, offsets = np.stack([-slopes[0], slopes[0]]), np.stack([-offsets[0], offsets[0]])
    weights = np.zeros((len(patches.classes), features.FEATURE_COUNT))
    bias = np.full(len(patches.classes), -np.inf)
    weights[present], bias[present] = slopes, offsets
    return Teacher(
        patches.classes, weights, bias, features.palette_of_counts(patches.colour_counts), config
    )


def save_teacher(path: Path, teacher: Teacher) -> None:
    """Write the teacher as safetensors; the file is replaced in one step."""
    palette = teacher.palette.astype(np.float16)  # error of a likelihood: 0.4 %
    write_weights(
        path,
        {"weights": teacher.weights, "bias": teacher.bias, "palette": palette},
        kind=_KIND,
        details={"config": asdict(teacher.config), "classes": teacher.classes.names},
    )


def load_teacher(path: Path, classes: LabClasses) -> Teacher:
    """Read a teacher of a lab with these classes; another file is a WeightsError."""
    tensors, details = read_weights(path, kind=_KIND, remedy="`uav-bt lab train` makes one")
    count = len(classes)
    try:
        config = TeacherConfig(**details["config"])
        if list(classes.names) != details["classes"]:
            raise WeightsError(
                path,
                f"expected the classes {', '.join(classes.names)} of the lab, got "
                f"{', '.join(details['classes'])}; train a teacher on picks of this lab",
            )
        weights = tensors["weights"].reshape(count, features.FEATURE_COUNT)
        palette = tensors["palette"].reshape(count, features.COLOUR_COUNT).astype(np.float32)
        return Teacher(classes, weights, tensors["bias"].reshape(count), palette, config)
    except (KeyError, TypeError, ValueError) as error:
        raise WeightsError(path, f"is not a whole teacher ({error!r}); train it anew") from error
