"""The network with two heads in flight: roles and relative depth of a frame by one inference."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from perception.networks.inference_packages import import_openvino
from perception.networks.onnx_runtime import (
    accept_uint8,
    compile_model,
    input_size,
    read_model,
    shrunk,
)
from uav_bt.errors import AnswerError, WeightsError
from uav_bt.lab.classes import OBSTACLE, OUTSIDE, LabClasses
from uav_bt.types import ClassMap, DepthMap, Frame


class RoomSegmenter:
    """A network for any room: it has roles instead of classes.

    A role becomes a class of the lab: the first class that is outside, the first ground, and the
    first obstacle that is no upper face. The network has no landing marks.

    Args:
        path: the ONNX file, with the outputs `logits` (1, 3, H, W) of outside, ground and obstacle,
            and `depth` (1, 1, h, w).
        classes: classes of the lab.
        threads: number of inference threads.

    Raises:
        WeightsError: the file is absent or damaged, or has other outputs.
    """

    def __init__(self, path: Path, classes: LabClasses, *, threads: int = 1) -> None:
        self._path, self._classes = path, classes
        model = read_model(path, "docs/any-room.md: the command")
        self._size = input_size(model, path)
        self._table = np.array(
            [classes.of_role(OUTSIDE)[0], classes.ground, _obstacle_of(classes)], np.uint8
        )
        self._request = compile_model(
            _with_numbers(accept_uint8(model), path), threads, path
        ).create_infer_request()
        self._depth: DepthMap | None = None
        self._run(np.full((self._size[1], self._size[0], 3), 127, np.uint8))  # warm-up

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height of the network's input, px; frames are resized to them."""
        return self._size

    @property
    def relative_depth(self) -> DepthMap | None:
        """Depth of the frame that was segmented last, in heights of the camera above the ground."""
        return self._depth

    def segment(self, frame: Frame) -> ClassMap:
        """Return the class map of a frame, at the size of the network's input.

        Raises:
            AnswerError: the network's output holds NaN or infinity.
        """
        class_map, self._depth = self._perceive(frame)
        return class_map

    def estimate(self, frame: Frame) -> DepthMap:
        """Return the relative depth of a frame; that of the last one is known already."""
        if self._depth is not None and self._depth.captured_s == frame.captured_s:
            return self._depth
        return self._perceive(frame)[1]

    def _perceive(self, frame: Frame) -> tuple[ClassMap, DepthMap]:
        numbers, depth = self._run(shrunk(frame.image, self._size))
        ids, captured_s = self._table[numbers], frame.captured_s
        return (
            ClassMap(ids=ids, classes=self._classes, captured_s=captured_s),
            DepthMap(depth=depth, metric=False, captured_s=captured_s, in_heights=True),
        )

    def _run(self, rgb: NDArray[np.uint8]) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
        self._request.infer([np.ascontiguousarray(rgb[None])])
        numbers, sound, depth = (self._request.get_output_tensor(at).data for at in range(3))
        if not bool(sound):
            raise AnswerError(self._path, "the network's answer holds NaN or infinity")
        height, width = numbers.shape[-2:]
        # A copy: the next frame overwrites the tensor.
        return numbers.reshape(height, width), np.array(depth.reshape(depth.shape[-2:]), np.float32)


def _obstacle_of(classes: LabClasses) -> int:
    return next(iter(classes.standing), classes.of_role(OBSTACLE)[0])


def _with_numbers(model: Any, path: Path) -> Any:
    """Return the network with the best role's number, soundness and depth as its outputs."""
    openvino = import_openvino()
    ops = openvino.opset13
    outputs = {next(iter(port.get_names())): port for port in model.outputs if port.get_names()}
    if not {"logits", "depth"} <= set(outputs):
        raise WeightsError(path, f"expected the outputs logits and depth, got {sorted(outputs)}")
    logits, depth = (outputs[name].get_node().input_value(0) for name in ("logits", "depth"))
    shape = logits.get_partial_shape()
    if len(shape) != 4 or shape[1] != 3:
        raise WeightsError(path, f"expected scores of three roles, 1x3xHxW, got {shape}")
    best = ops.topk(
        logits, ops.constant(np.int64(1)), 1, "max", "none", index_element_type="i32"
    ).output(1)
    axes = ops.constant(np.arange(4))
    sound = [
        ops.reduce_logical_and(ops.is_finite(each), axes, keep_dims=False)
        for each in (logits, depth)
    ]
    results = [ops.result(best), ops.result(ops.logical_and(*sound)), ops.result(depth)]
    return openvino.Model(results, model.get_parameters(), model.get_friendly_name())
