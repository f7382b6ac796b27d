"""Class maps of a lab's images, from which its network learns; finished ones are kept."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Final

import cv2
import numpy as np

from perception.camera.image_files import read_image
from perception.networks.onnx_runtime import shrunk
from perception.segmentation.clean import REFINED_BY
from perception.segmentation.runtime import MAP_PX, OnnxSegmenter, TeacherSegmenter
from perception.segmentation.teacher import load_teacher
from uav_bt.errors import FileError
from uav_bt.files import whole_file
from uav_bt.lab.classes import LabClasses
from uav_bt.progress import Advance, silent
from uav_bt.types import Frame
from uav_bt.types.arrays import Image

SIZE_PX: Final = MAP_PX
"""Width and height of the masks, of the network's images and of its class maps."""

_PART: Final = 10  # images that a process labels at a time


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
        teacher = TeacherSegmenter(load_teacher(self.file, self.classes))
        return lambda rgb: teacher.segment(_frame(rgb)).ids

    @property
    def fingerprint(self) -> str:
        """Hash of all that the masks of an image depend on."""
        about = {"size": SIZE_PX, "refine": REFINED_BY, "classes": self.classes.names}
        text = json.dumps(about, sort_keys=True).encode()
        if self.file.suffix.lower() == ".onnx":
            files = [self.file] if self.mapping is None else [self.file, self.mapping]
            return _digest(text, *(file.read_bytes() for file in files))
        # Of its numbers, because the same weights may be written in another order.
        teacher = load_teacher(self.file, self.classes)
        tensors = (teacher.weights, teacher.bias, teacher.palette)
        config = json.dumps(asdict(teacher.config), sort_keys=True).encode()
        return _digest(text, config, *(each.tobytes() for each in tensors))


def _frame(rgb: Image) -> Frame:
    return Frame(image=rgb, index=0, captured_s=0.0, gimbal_pitch_rad=0.0)


def _digest(*parts: bytes) -> str:
    return hashlib.sha256(b"\0".join(parts)).hexdigest()[:12]


def mask_files(images: Sequence[Path], folder: Path) -> dict[Path, Path]:
    """Return the file of each image's mask: a changed image has another one."""
    return {each: folder / f"{each.stem}-{_digest(each.read_bytes())}.npz" for each in images}


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
        Images (N, h, w, 3) and class ids (N, h, w), both of `SIZE_PX`.
    """
    folder.mkdir(parents=True, exist_ok=True)
    files = mask_files(images, folder)
    todo = [(image, file) for image, file in files.items() if not file.is_file()]
    done = len(files) - len(todo)
    advance("masks", done, len(files))
    if todo and workers == 1:
        for _ in _made(source, todo):
            done += 1
            advance("masks", done, len(files))
    elif todo:
        # Spawned: a fork would copy the threads' locks of the inference runtime.
        with ProcessPoolExecutor(max_workers=workers, mp_context=get_context("spawn")) as pool:
            parts = [todo[first : first + _PART] for first in range(0, len(todo), _PART)]
            jobs = [pool.submit(_make_all, source, part) for part in parts]
            for job in as_completed(jobs):
                done += job.result()
                advance("masks", done, len(files))
    rgb, ids = zip(*(_kept(file) for file in files.values()), strict=True)
    return np.stack(rgb), np.stack(ids)


def _make_all(source: MaskSource, todo: Sequence[tuple[Path, Path]]) -> int:
    return len(list(_made(source, todo)))


def _made(source: MaskSource, todo: Sequence[tuple[Path, Path]]) -> Iterator[Path]:
    make = source.load()
    for image, file in todo:
        rgb = read_image(image, colour=True, as_stored=False)
        ids = cv2.resize(make(rgb), SIZE_PX, interpolation=cv2.INTER_NEAREST_EXACT)
        with whole_file(file) as partial, partial.open("wb") as out:
            np.savez_compressed(out, rgb=shrunk(rgb, SIZE_PX), ids=ids)
        yield file


def _kept(file: Path) -> tuple[Image, Image]:
    try:
        with np.load(file, allow_pickle=False) as kept:
            return kept["rgb"], kept["ids"]
    except Exception as error:  # numpy raises various errors of zip, zlib and its parser
        raise FileError(file, f"is damaged ({error}); delete it, and it is made again") from error
