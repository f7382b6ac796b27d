"""Segmenters for flight: ONNX networks of classes or roles on the CPU, and the teacher itself."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.networks.mapping import ClassMapping, InputFormat, class_id_of, read_mapping
from perception.networks.onnx_runtime import OnnxNetwork
from perception.networks.weights_file import SHIPPED_WEIGHTS
from perception.segmentation.teacher import Teacher, load_teacher
from uav_bt.errors import AnswerError
from uav_bt.lab.classes import OBSTACLE, OUTSIDE, LabClasses
from uav_bt.lab.shipped import load_lab
from uav_bt.types import ClassMap, DepthMap, Frame
from uav_bt.types.arrays import Ids, Image

MAP_PX: Final = (224, 112)  # width and height of the class maps of the U-Net and of the teacher
_TRAIN: Final = "`uav-bt lab train`"


class OnnxSegmenter:
    """A segmentation network in an ONNX file.

    The network has one image as input. Its output has a score for each class, 1xCxHxW or 1xHxWxC,
    or the number of the class, 1xHxW or with one channel. Without a mapping, or a mapping file, its
    classes are those of the lab. A file that does not fit is a WeightsError.
    """

    def __init__(
        self,
        path: Path,
        classes: LabClasses,
        mapping: ClassMapping | Path | None = None,
        *,
        threads: int = 1,
    ) -> None:
        self._classes = classes
        stated = read_mapping(mapping, classes) if isinstance(mapping, Path) else mapping
        meant = stated or ClassMapping.identity(classes)
        self._network = network = OnnxNetwork(path, _TRAIN)
        if stated is None and network.about("classes") not in (None, json.dumps(classes.names)):
            raise network.refused(
                f"expected the classes {', '.join(classes.names)} of the lab, and the network "
                f"states {network.about('classes'):.200}: train a network for this lab, or give a "
                "class mapping"
            )
        self.size_px = network.take_images(meant.input)
        output = next(iter(network.outputs().values()))
        if (size := output.get_partial_shape()).is_dynamic:
            raise network.refused(f"the output must be of fixed size, got {size}")
        self._axis, self._pixels = _form(network, tuple(output.get_shape()), meant)
        if self._axis is None:
            kind = output.get_element_type()
            if set(meant.classes) == {0} and (kind.is_real() or kind.to_string() == "boolean"):
                raise network.refused(
                    "a network of one class, class 0, does not say what its numbers mean; export "
                    "it with a score for each of two classes"
                )
            # Class numbers do not show the number of classes, so the table covers the listed ones.
            count = max(meant.classes) + 1
        else:
            count = output.get_shape()[self._axis]
            if stated is None and count != len(classes):
                raise network.refused(
                    f"expected scores of the {len(classes)} classes of the lab, and the network "
                    f"gives {count}: give a class mapping"
                )
        self._table = meant.table(count, classes)
        self._default = np.uint8(class_id_of(meant.default, classes))
        (grey,) = network.compile([output], threads, class_axis=self._axis)
        if np.isfinite(grey).all():
            self._ids_of(grey)

    def segment(self, frame: Frame) -> ClassMap:
        """Return the class map of a frame, at the size of the network's output.

        AnswerError if the output holds NaN, infinity or no class number.
        """
        ids = self.ids(frame.image)
        return ClassMap(ids=ids, classes=self._classes, captured_s=frame.captured_s)

    def ids(self, rgb: Image) -> Ids:
        """Return class ids, (h, w) uint8, of an image, (H, W, 3) uint8 RGB."""
        return self._ids_of(self._network.run(rgb)[0])

    def _ids_of(self, answer: NDArray[Any]) -> Ids:
        numbers = answer.reshape(self._pixels)
        if self._axis is not None:
            return self._table.take(numbers)
        whole = numbers.astype(np.int64)
        if (whole != numbers).any():
            raise AnswerError(
                self._network.path,
                "class numbers must be whole numbers, and the network gives "
                f"{numbers[whole != numbers][0]:.3g}; a network of scores needs a channel for each "
                "class",
            )
        known = (whole >= 0) & (whole < len(self._table))
        return np.where(known, self._table[np.where(known, whole, 0)], self._default)


def _form(
    network: OnnxNetwork, shape: tuple[int, ...], mapping: ClassMapping
) -> tuple[int | None, tuple[int, ...]]:
    """Return the axis of the scores (None: the output has class numbers), and rows and columns.

    Scores come before or after rows and columns, which are recognised by the aspect ratio of the
    input. If both places fit, the class list decides: the mapping must not name a class that the
    network does not have.
    """
    given = "x".join(map(str, shape))
    if len(shape) not in (3, 4) or shape[0] != 1:
        raise network.refused(f"the output must be 1xCxHxW, 1xHxWxC or 1xHxW, got {given}")
    pixels = {1: shape[2:], 3: shape[1:3]}
    if len(shape) == 3 or 1 in (shape[1], shape[3]):
        return None, shape[1:] if len(shape) == 3 else pixels[1 if shape[1] == 1 else 3]
    if mapping.output is not None:
        axis = 1 if mapping.output == "nchw" else 3
        return axis, pixels[axis]
    width_px, height_px = network.size_px
    off = {at: abs(rows * width_px - columns * height_px) for at, (rows, columns) in pixels.items()}
    # An exact fit is preferred to one with both sizes rounded, each by less than a pixel.
    most = 1 if 0 in off.values() else width_px + height_px
    fitting = [at for at in off if off[at] < most]
    if len(fitting) > 1:
        fitting = [at for at in fitting if max(mapping.classes) < shape[at]]
    if len(fitting) != 1:
        raise network.refused(
            f"the output {given} does not show whether classes come before or after rows and "
            "columns; add `output: nchw` or `output: nhwc` to the network's mapping file"
        )
    return fitting[0], pixels[fitting[0]]


class RoomSegmenter:
    """A network that knows three roles in any room, and gives relative depth with them.

    A pixel's role is shown as the lab's first class of this role (of obstacles the first that is
    no upper face). Outputs of the network: `logits` (1, 3, H, W), and `depth` (1, 1, h, w).
    """

    def __init__(self, path: Path, classes: LabClasses, *, threads: int = 1) -> None:
        self._classes = classes
        obstacle = next(iter(classes.standing), classes.of_role(OBSTACLE)[0])
        self._table = np.array([classes.of_role(OUTSIDE)[0], classes.ground, obstacle], np.uint8)
        self._network = network = OnnxNetwork(path, "perception/weights/any.md: the command")
        self.size_px = network.take_images(InputFormat())
        outputs = network.outputs()
        if not {"logits", "depth"} <= set(outputs):
            raise network.refused(
                f"expected the outputs logits and depth, got {', '.join(sorted(outputs))}"
            )
        shape = outputs["logits"].get_partial_shape()
        if len(shape) != 4 or shape[1] != 3:
            raise network.refused(f"expected scores of three roles, 1x3xHxW, got {shape}")
        network.compile([outputs["logits"], outputs["depth"]], threads, class_axis=1)
        self.relative_depth: DepthMap | None = None  # of the frame that was segmented last

    def segment(self, frame: Frame) -> ClassMap:
        """Return the class map of a frame, at the size of the network's input."""
        class_map, self.relative_depth = self._perceive(frame)
        return class_map

    def estimate(self, frame: Frame) -> DepthMap:
        """Return the relative depth of a frame; that of the last one is known already."""
        last = self.relative_depth
        if last is not None and last.captured_s == frame.captured_s:
            return last
        return self._perceive(frame)[1]

    def _perceive(self, frame: Frame) -> tuple[ClassMap, DepthMap]:
        roles, depths = self._network.run(frame.image)
        ids, at_s = self._table[roles.reshape(roles.shape[-2:])], frame.captured_s
        # A copy: the next frame overwrites the output.
        depth = np.array(depths.reshape(depths.shape[-2:]), np.float32)
        class_map = ClassMap(ids=ids, classes=self._classes, captured_s=at_s)
        return class_map, DepthMap(depth=depth, metric=False, captured_s=at_s, in_heights=True)


class TeacherSegmenter:
    """The teacher in flight: slower than the U-Net, but trained directly on the picks."""

    def __init__(self, teacher: Teacher, *, sharp: bool = True) -> None:
        """Take a teacher; without `sharp` its maps are those of the paper's procedure."""
        self._teacher, self._ids = teacher, teacher.refined_ids if sharp else teacher.paper_ids

    def segment(self, frame: Frame) -> ClassMap:
        """Return the class map of a frame, at the size of the U-Net's."""
        whole = self._ids(self._teacher.resized(frame.image))
        small = cv2.resize(whole, MAP_PX, interpolation=cv2.INTER_NEAREST_EXACT)
        ids, classes = np.asarray(small, dtype=np.uint8), self._teacher.classes
        return ClassMap(ids=ids, classes=classes, captured_s=frame.captured_s)


def load_segmenter(
    path: Path, classes: LabClasses, mapping: ClassMapping | None = None, *, threads: int = 1
) -> OnnxSegmenter | RoomSegmenter:
    """Return the segmenter of an ONNX file: of roles, or of classes; arguments as there.

    Without a mapping it is one of roles if the file's metadata states roles.
    """
    if mapping is None and OnnxNetwork(path, _TRAIN).about("roles") is not None:
        return RoomSegmenter(path, classes, threads=threads)
    return OnnxSegmenter(path, classes, mapping, threads=threads)


def shipped_unet(*, threads: int = 1) -> OnnxSegmenter:
    """Return the shipped segmentation U-Net; its classes are those of the paper's lab."""
    return OnnxSegmenter(SHIPPED_WEIGHTS / "unet.onnx", load_lab().classes, threads=threads)


def shipped_teacher(classes: LabClasses) -> TeacherSegmenter:
    """Return the shipped teacher, of a lab with the classes of the paper's."""
    return TeacherSegmenter(load_teacher(SHIPPED_WEIGHTS / "teacher.safetensors", classes))
