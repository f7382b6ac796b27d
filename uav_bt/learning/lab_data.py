"""Checked training files of a lab, and the class maps from which its network learns.

A teacher of the picks makes them, or a network that the lab file names. Finished ones are kept.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from itertools import repeat
from multiprocessing import get_context
from pathlib import Path
from typing import Final

import cv2
import numpy as np

from perception.camera.image_files import read_image
from perception.networks.mapping import class_id_of, read_mapping
from perception.networks.onnx_runtime import shrunk
from perception.segmentation.clean import REFINED_BY
from perception.segmentation.runtime import MAP_PX, OnnxSegmenter
from perception.segmentation.teacher import load_teacher
from perception.segmentation.training.pick_images import check_picks, placed_picks
from perception.segmentation.training.picks import Pick
from uav_bt.errors import FileError, InputError
from uav_bt.files import whole_file
from uav_bt.lab.classes import GROUND, LabClasses
from uav_bt.lab.lab_file import lab_text
from uav_bt.learning.lab_material import LabMaterial, Use
from uav_bt.protocols import Advance, silent
from uav_bt.types.arrays import Image

_LEAST_IMAGES: Final = 4
_FEW_IMAGES: Final = 100  # with fewer the network knows few views; chosen
_PART: Final = 10  # images that are labelled at a time


@dataclass(frozen=True, kw_only=True)
class MaskSource:
    """What makes the masks."""

    file: Path  # weights of a teacher (safetensors), or a segmentation network (ONNX)
    classes: LabClasses  # classes of the lab
    # class-mapping file of the network; None: it has the classes of the lab
    mapping: Path | None = None

    def load(self) -> Callable[[Image], Image]:
        """Return a function from an image, (H, W, 3) RGB, to its class ids, (h, w)."""
        if self.file.suffix.lower() == ".onnx":
            return OnnxSegmenter(self.file, self.classes, self.mapping).ids
        teacher = load_teacher(self.file, self.classes)
        return lambda rgb: _small(teacher.refined_ids(teacher.resized(rgb)))

    @property
    def fingerprint(self) -> str:
        """Hash of all that the masks of an image depend on."""
        about = {"size": MAP_PX, "refine": REFINED_BY, "classes": self.classes.names}
        text = json.dumps(about, sort_keys=True).encode()
        if self.file.suffix.lower() == ".onnx":
            files = [self.file] if self.mapping is None else [self.file, self.mapping]
            return digest(text, *(file.read_bytes() for file in files))
        # Of its numbers, because the same weights may be written in another order.
        teacher = load_teacher(self.file, self.classes)
        tensors = (teacher.weights, teacher.bias, teacher.palette)
        config = json.dumps(asdict(teacher.config), sort_keys=True).encode()
        return digest(text, config, *(each.tobytes() for each in tensors))


@dataclass(frozen=True, kw_only=True)
class LabData:
    """Checked training files of a lab."""

    material: LabMaterial  # where they are
    uses: Mapping[str, Use]  # use of every image, by file name
    picks: Sequence[Pick]  # on all images; may be empty with a `source`
    source: MaskSource | None  # network of the lab file; None: a teacher learns from picks
    warnings: Sequence[str]  # allowed things that may be mistakes

    def images(self, use: Use) -> list[Path]:
        """Return the images of a use, in the order of names."""
        return [self.material.frames / name for name, its in self.uses.items() if its == use]

    def picks_on(self, use: Use) -> list[Pick]:
        """Return the picks on the images of a use."""
        return [pick for pick in self.picks if self.uses[pick.image] == use]


def checked_data(material: LabMaterial) -> LabData:
    """Check everything that training needs, before hours of work."""
    uses, warnings = material.uses(), []
    for name in list(uses):
        try:
            read_image(material.frames / name, colour=True, as_stored=False)
        except FileError as error:
            warnings.append(f"{error}; it is left out")
            del uses[name]
    source = teacher_of_lab(material)
    count = sum(use == "train" for use in uses.values())
    if count < _LEAST_IMAGES:
        raise InputError(
            f"{material.frames}: expected at least {_LEAST_IMAGES} images for training, got "
            f"{count}; `uav-bt lab frames` takes them from videos"
        )
    if count < _FEW_IMAGES:
        warnings.append(f"only {count} images for training")
    picks: list[Pick] = []
    if source is None or material.picks.exists():
        picks = picks_of_lab(material, uses)
    if source is None:
        warnings += check_picks(material.picks, material.frames, material.lab.classes, uses)
    return LabData(material=material, uses=uses, picks=picks, source=source, warnings=warnings)


def picks_of_lab(material: LabMaterial, uses: Mapping[str, Use]) -> list[Pick]:
    """Return the picks of a lab, each of which lies inside its image."""
    if not material.picks.exists():
        raise FileError(material.picks, "there are no picks; `uav-bt lab pick` makes them")
    return placed_picks(material.picks, material.frames, material.lab.classes, uses)


def teacher_of_lab(material: LabMaterial) -> MaskSource | None:
    """Return the network that the lab file names for masks; None without one."""
    lab = material.lab
    if lab.teacher is None:
        return None
    mapping = lab.teacher.get("classes")
    source = MaskSource(file=lab.teacher["model"], classes=lab.classes, mapping=mapping)
    try:
        source.load()
    except InputError as error:
        raise lab_text(lab.file).error(str(error), "teacher", "model") from error
    if mapping is not None:
        meant = read_mapping(mapping, lab.classes)
        ids = {class_id_of(name, lab.classes) for name in (*meant.classes.values(), meant.default)}
        if not ids.intersection(lab.classes.of_role(GROUND)):
            what = f"{mapping} maps no class to the ground"
            raise lab_text(lab.file).error(what, "teacher", "classes")
    return source


def digest(*parts: bytes) -> str:
    """Return a short hash of contents."""
    return hashlib.sha256(b"\0".join(parts)).hexdigest()[:12]


def mask_files(images: Sequence[Path], folder: Path) -> dict[Path, Path]:
    """Return the file of each image's mask: a changed image has another one."""
    return {each: folder / f"{each.stem}-{digest(each.read_bytes())}.npz" for each in images}


def make_masks(
    source: MaskSource,
    images: Sequence[Path],
    folder: Path,
    *,
    workers: int = 1,
    advance: Advance = silent,
) -> tuple[Image, Image]:
    """Make the masks of images; those in the folder are taken from there.

    Returns:
        Images (N, h, w, 3) and class ids (N, h, w), both of `MAP_PX`.
    """
    folder.mkdir(parents=True, exist_ok=True)
    files = mask_files(images, folder)
    todo = [(image, file) for image, file in files.items() if not file.is_file()]
    parts = [todo[first : first + _PART] for first in range(0, len(todo), _PART)]
    done = len(files) - len(todo)
    advance("masks", done, len(files))
    # Spawned, once it is used: a fork would copy locks of the inference runtime's threads.
    with ProcessPoolExecutor(max_workers=workers, mp_context=get_context("spawn")) as pool:
        for made in (map if workers == 1 else pool.map)(_make, repeat(source), parts):
            done += made
            advance("masks", done, len(files))
    kept = []
    for file in files.values():
        try:
            with np.load(file, allow_pickle=False) as arrays:
                kept.append((arrays["rgb"], arrays["ids"]))
        except Exception as error:  # numpy raises various errors of zip, zlib and its parser
            remedy = "delete it, and it is made again"
            raise FileError(file, f"is damaged ({error}); {remedy}") from error
    rgb, ids = zip(*kept, strict=True)
    return np.stack(rgb), np.stack(ids)


def _small(ids: Image) -> Image:
    small = cv2.resize(ids, MAP_PX, interpolation=cv2.INTER_NEAREST_EXACT)
    return np.asarray(small, dtype=np.uint8)


def _make(source: MaskSource, todo: Sequence[tuple[Path, Path]]) -> int:
    make = source.load()
    for image, file in todo:
        rgb = read_image(image, colour=True, as_stored=False)
        ids = _small(make(rgb))
        with whole_file(file) as partial, partial.open("wb") as out:
            np.savez_compressed(out, rgb=shrunk(rgb, MAP_PX), ids=ids)
    return len(todo)
