"""Segmenters for flight: any ONNX network on the CPU, and the teacher itself."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.networks.named import SHIPPED_UNET
from perception.networks.onnx_runtime import (
    accept_uint8,
    class_numbers,
    compile_model,
    input_size,
    is_room_network,
    read_model,
    shrunk,
)
from perception.networks.weights_file import SHIPPED_WEIGHTS
from perception.segmentation.clean import RefineConfig
from perception.segmentation.mapping import ClassMapping, class_id_of, read_mapping
from perception.segmentation.output_form import OutputForm, output_form
from perception.segmentation.room_runtime import RoomSegmenter
from perception.segmentation.teacher import Teacher, load_teacher
from uav_bt.errors import AnswerError, ValueRangeError, WeightsError
from uav_bt.lab.classes import LabClasses
from uav_bt.lab.shipped import load_lab
from uav_bt.types import ClassMap, Frame

_SHIPPED_TEACHER: Final = SHIPPED_WEIGHTS / "teacher.safetensors"
_SHARP: Final = RefineConfig()
_CLASSES: Final = ["framework", "classes"]  # where OpenVINO keeps an ONNX file's metadata
_PROBABLE: Final = 0.5  # default threshold of a probability; chosen


class OnnxSegmenter:
    """A segmentation network in an ONNX file, run by OpenVINO.

    The network has one image as input and one output, see `OutputForm`. The same frame always gives
    the same class map, also under load.

    Args:
        path: the ONNX file.
        classes: classes of the lab.
        mapping: meaning of its classes, or a mapping file; None for a network with the classes of
            the lab.
        threads: number of inference threads.

    Raises:
        WeightsError: the file is absent or damaged, the network is not for segmentation, or it
            has other classes than the lab and no mapping.
        FileError: the mapping file is absent or malformed.
        ValueRangeError: the mapping names a class that the network does not have.
    """

    def __init__(
        self,
        path: Path,
        classes: LabClasses,
        mapping: ClassMapping | Path | None = None,
        *,
        threads: int = 1,
    ) -> None:
        self._path, self._classes = path, classes
        self._mapping = _mapping_of(mapping, classes)
        self._default = class_id_of(self._mapping.default, classes)
        model = read_model(path, "`uav-bt lab train`")
        if mapping is None:
            _check_classes(model, path, classes)
        wanted = self._mapping.input
        planar = wanted.layout == "nchw"
        self._size = input_size(model, path, planar=planar, size_px=wanted.size)
        model = accept_uint8(
            model, planar=planar, mean=wanted.mean, scale=wanted.scale, colours=wanted.colours
        )
        shape = model.output(0).get_partial_shape()
        if shape.is_dynamic:
            raise WeightsError(path, f"the output must be of fixed size, got {shape}")
        self._form = self._output_form([int(length) for length in shape.to_shape()], model)
        self._scores = self._form in (OutputForm.SCORES_FIRST, OutputForm.SCORES_LAST)
        if self._mapping.threshold is not None and self._form is not OutputForm.ONE_CLASS:
            raise WeightsError(
                path,
                "the mapping has a threshold, but the network is not one of one class: its output "
                "must have one channel of floats, and the mapping must list class 0 only",
            )
        planar_output = self._form is OutputForm.SCORES_FIRST
        # Class numbers do not show the number of classes, so the table covers the listed ones.
        count = (
            shape[1 if planar_output else 3].get_length()
            if self._scores
            else max(self._mapping.classes) + 1
        )
        if mapping is None and self._scores and count != len(classes):
            raise WeightsError(
                path,
                f"expected scores of the {len(classes)} classes of the lab, and the network gives "
                f"{count}: give a class mapping",
            )
        self._table = self._mapping.table(count, classes)
        if self._scores:
            model = class_numbers(model, planar=planar_output)
        self._request = compile_model(model, threads, path).create_infer_request()
        self._run(np.full((self._size[1], self._size[0], 3), 127, dtype=np.uint8))  # warm-up

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height of the network's input, px; frames are resized to them."""
        return self._size

    def segment(self, frame: Frame) -> ClassMap:
        """Return the class map of a frame, at the size of the network's output.

        Raises:
            AnswerError: the network's output holds NaN or infinity.
            WeightsError: the network's output does not fit its mapping.
        """
        ids = self.ids(frame.image)
        return ClassMap(ids=ids, classes=self._classes, captured_s=frame.captured_s)

    def ids(self, rgb: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Return class ids, (h, w) uint8, of an image, (H, W, 3) uint8 RGB."""
        numbers, sound = self._run(shrunk(rgb, self._size))
        if not sound:
            raise AnswerError(self._path, "the network's answer holds NaN or infinity")
        if self._scores:
            return np.asarray(self._table[numbers], dtype=np.uint8)
        known = (numbers >= 0) & (numbers < len(self._table))
        ours = self._table[np.where(known, numbers, 0)]
        return np.where(known, ours, np.uint8(self._default))

    def _output_form(self, shape: list[int], model: Any) -> OutputForm:
        kind = model.output(0).get_element_type()
        whole_numbers = not kind.is_real() and kind.to_string() != "boolean"
        try:
            return output_form(shape, self._size, self._mapping, whole_numbers=whole_numbers)
        except ValueRangeError as error:
            raise WeightsError(self._path, str(error)) from error

    def _run(self, rgb: NDArray[np.uint8]) -> tuple[NDArray[Any], bool]:
        """Return class numbers, (h, w), and whether the network's output is finite."""
        self._request.infer([np.ascontiguousarray(rgb[None])])
        output = np.asarray(self._request.get_output_tensor(0).data)
        if self._scores:
            numbers = output.reshape(output.shape[-2:])
            return numbers, bool(self._request.get_output_tensor(1).data)
        rows_first = output.ndim == 3 or output.shape[1] != 1
        answer = output.reshape(output.shape[1:3] if rows_first else output.shape[2:])
        if not np.isfinite(answer).all():
            return answer, False
        if self._form is OutputForm.ONE_CLASS:
            return self._beyond_threshold(answer), True
        if (answer != np.floor(answer)).any():
            raise WeightsError(
                self._path,
                "class numbers must be whole numbers, and the network gives "
                f"{answer[answer != np.floor(answer)][0]:.3g}; for the probability of one class, "
                "list class 0 only in the mapping",
            )
        return answer.astype(np.int64), True

    def _beyond_threshold(self, answer: NDArray[Any]) -> NDArray[np.int64]:
        """Return class 0 where the output is above the threshold, else 1, an unlisted class."""
        threshold = self._mapping.threshold
        if threshold is None:
            threshold = _PROBABLE
            if answer.min() < 0 or answer.max() > 1:
                raise WeightsError(
                    self._path,
                    "a network of one class must give probabilities within 0 and 1, got "
                    f"{float(answer.min()):.3g} to {float(answer.max()):.3g}; if it gives scores "
                    "before the sigmoid, add `threshold: 0` to the mapping file",
                )
        return np.where(answer > threshold, 0, 1)


class TeacherSegmenter:
    """The teacher in flight: slower than the U-Net, but trained directly on the picks.

    Args:
        teacher: the trained teacher.
        refine: how to sharpen its borders; None for the paper's procedure.
        size_px: width and height of the class maps; by default those of the U-Net.
    """

    def __init__(
        self,
        teacher: Teacher,
        refine: RefineConfig | None = _SHARP,
        *,
        size_px: tuple[int, int] = (224, 112),
    ) -> None:
        self._teacher, self._refine = teacher, refine
        self._size = size_px

    def segment(self, frame: Frame) -> ClassMap:
        """Return the class map of a frame."""
        rgb = self._teacher.resized(frame.image)
        if self._refine is None:
            ids = self._teacher.paper_ids(rgb)
        else:
            ids = self._teacher.refined_ids(rgb, self._refine)
        small = cv2.resize(ids, self._size, interpolation=cv2.INTER_NEAREST_EXACT)
        return ClassMap(
            ids=np.asarray(small, dtype=np.uint8),
            classes=self._teacher.classes,
            captured_s=frame.captured_s,
        )


def load_segmenter(
    path: Path, classes: LabClasses, mapping: ClassMapping | None = None, *, threads: int = 1
) -> OnnxSegmenter | RoomSegmenter:
    """Return the segmenter of an ONNX file: one of roles, or one of classes.

    Args:
        path: the ONNX file.
        classes: classes of the lab.
        mapping: meaning of its classes; None for a network of roles, or with the lab's classes.
        threads: number of inference threads.

    Raises:
        WeightsError: the file cannot be used.
        ValueRangeError: the mapping names a class that the network does not have.
    """
    model = read_model(path, "`uav-bt lab train`")
    if mapping is None and is_room_network(model):
        return RoomSegmenter(path, classes, threads=threads)
    return OnnxSegmenter(path, classes, mapping, threads=threads)


def shipped_unet(*, threads: int = 1) -> OnnxSegmenter:
    """Return the shipped segmentation U-Net; its classes are those of the paper's lab.

    Args:
        threads: number of inference threads.
    """
    path = SHIPPED_WEIGHTS / f"{SHIPPED_UNET}.onnx"
    return OnnxSegmenter(path, load_lab().classes, threads=threads)


def shipped_teacher(
    classes: LabClasses, *, refine: RefineConfig | None = _SHARP
) -> TeacherSegmenter:
    """Return the shipped teacher.

    Args:
        classes: classes of the lab.
        refine: how to sharpen borders; None for the paper's procedure.

    Raises:
        WeightsError: the lab has other classes than the paper's lab.
    """
    return TeacherSegmenter(load_teacher(_SHIPPED_TEACHER, classes), refine)


def _check_classes(model: Any, path: Path, classes: LabClasses) -> None:
    """Refuse a network that states other classes than those of the lab, in its metadata."""
    if not model.has_rt_info(_CLASSES):
        return
    stated = model.get_rt_info(_CLASSES).astype(str)
    if stated != json.dumps(classes.names):
        raise WeightsError(
            path,
            f"expected the classes {', '.join(classes.names)} of the lab, and the network states "
            f"{stated:.200}: train a network for this lab, or give a class mapping",
        )


def _mapping_of(mapping: ClassMapping | Path | None, classes: LabClasses) -> ClassMapping:
    if mapping is None:
        return ClassMapping.identity(classes)
    return read_mapping(mapping, classes) if isinstance(mapping, Path) else mapping
