"""Segmenters for flight: any ONNX network on the CPU, and the teacher itself."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.networks.onnx_runtime import compile_model, input_size, read_model, shrunk
from perception.segmentation.mapping import ClassMapping, read_mapping
from perception.segmentation.refine import RefineConfig, refined_ids
from perception.segmentation.teacher import Teacher, load_teacher
from perception.weights_io import SHIPPED_WEIGHTS
from uav_bt.errors import ValueRangeError, WeightsError
from uav_bt.types import ClassMap, Frame

__all__ = ["OnnxSegmenter", "TeacherSegmenter", "shipped_teacher", "shipped_unet"]

_SHIPPED_UNET: Final = SHIPPED_WEIGHTS / "unet.onnx"
_SHIPPED_TEACHER: Final = SHIPPED_WEIGHTS / "teacher.safetensors"
_SHARP: Final = RefineConfig()


class OnnxSegmenter:
    """A segmentation network in an ONNX file, run by OpenVINO.

    The network has one picture as input, of a fixed size, and one output: class scores
    (1, C, h, w) or class numbers (1, h, w) or (1, 1, h, w). The same frame always gives the same
    class map, also with other work beside it.
    """

    def __init__(
        self, path: Path, mapping: ClassMapping | Path | None = None, *, threads: int = 1
    ) -> None:
        """Load and compile the network.

        Args:
            path: the ONNX file.
            mapping: what its classes mean, or the file that says so; None for a network that speaks
                our seventeen.
            threads: of inference.

        Raises:
            WeightsError: the file is absent or damaged, or the network is no segmentation network.
            FileError: the mapping's file is absent or malformed.
            ValueRangeError: the mapping names a class that the network does not have.
        """
        if threads < 1:
            raise ValueRangeError(f"inference needs at least one thread, got {threads}")
        self._path = path
        self._mapping = _mapping_of(mapping)
        model = read_model(path, "`uav-bt train segmentation`")
        planar = self._mapping.input.layout == "nchw"
        self._size = input_size(model, path, planar=planar)
        self._request = compile_model(model, threads).create_infer_request()
        grey = np.full((self._size[1], self._size[0], 3), 127, dtype=np.uint8)
        output = self._run(grey)
        scores = output.ndim == 4 and output.shape[1] > 1
        if output.ndim not in (3, 4) or output.shape[0] != 1:
            raise WeightsError(path, f"the output must be 1xCxHxW or 1xHxW, got {output.shape}")
        self._classes = output.shape[1] if scores else None
        # Class numbers do not say how many there can be: the table then covers what is mapped.
        count = self._classes or max(self._mapping.classes) + 1
        self._table = self._mapping.table(count)

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height that frames are resized to."""
        return self._size

    def segment(self, frame: Frame) -> ClassMap:
        """Return the class map of a frame, at the size of the network's output.

        Raises:
            WeightsError: the network answered with something that is not a number.
        """
        return ClassMap(ids=self.ids(frame.image), captured_s=frame.captured_s)

    def ids(self, rgb: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Return class ids, (h, w) uint8, of a picture, (H, W, 3) uint8 RGB."""
        output = self._run(shrunk(rgb, self._size))
        if not np.isfinite(output).all():
            raise WeightsError(self._path, "the network's answer holds NaN or infinity")
        if self._classes is not None:
            return np.asarray(self._table[output[0].argmax(axis=0)], dtype=np.uint8)
        numbers = output.reshape(output.shape[-2:]).astype(np.int64)
        known = (numbers >= 0) & (numbers < len(self._table))
        ours = self._table[np.where(known, numbers, 0)]
        return np.where(known, ours, np.uint8(self._mapping.default))

    def _run(self, rgb: NDArray[np.uint8]) -> NDArray[Any]:
        wanted = self._mapping.input
        mean, scale = np.array([wanted.mean, wanted.scale], dtype=np.float32)
        picture = (rgb.astype(np.float32) - mean) / scale
        if wanted.colours == "bgr":
            picture = picture[..., ::-1]
        if wanted.layout == "nchw":
            picture = picture.transpose(2, 0, 1)
        self._request.infer([np.ascontiguousarray(picture[None])])
        return np.asarray(self._request.get_output_tensor(0).data)


class TeacherSegmenter:
    """The teacher in flight: slow, but nothing stands between the picks and the class map."""

    def __init__(
        self,
        teacher: Teacher,
        refine: RefineConfig | None = _SHARP,
        *,
        size_px: tuple[int, int] = (224, 112),
    ) -> None:
        """Keep the teacher.

        Args:
            teacher: the trained teacher.
            refine: how to sharpen its borders; None leaves the map as the paper makes it.
            size_px: width and height of the class maps; that of the U-Net's by default.
        """
        self._teacher = teacher
        self._refine = refine
        self._size = size_px

    def segment(self, frame: Frame) -> ClassMap:
        """Return the class map of a frame."""
        rgb = self._teacher.resized(frame.image)
        if self._refine is None:
            ids = self._teacher.paper_ids(rgb)
        else:
            ids = refined_ids(self._teacher, rgb, self._refine)
        small = cv2.resize(ids, self._size, interpolation=cv2.INTER_NEAREST_EXACT)
        return ClassMap(ids=np.asarray(small, dtype=np.uint8), captured_s=frame.captured_s)


def shipped_unet(*, threads: int = 1) -> OnnxSegmenter:
    """Return the segmentation U-Net that comes with the package."""
    return OnnxSegmenter(_SHIPPED_UNET, threads=threads)


def shipped_teacher(*, refine: RefineConfig | None = _SHARP) -> TeacherSegmenter:
    """Return the teacher that comes with the package; without `refine`, the paper's plain one."""
    return TeacherSegmenter(load_teacher(_SHIPPED_TEACHER), refine)


def _mapping_of(mapping: ClassMapping | Path | None) -> ClassMapping:
    if mapping is None:
        return ClassMapping.identity()
    return read_mapping(mapping) if isinstance(mapping, Path) else mapping
