"""Inference of ONNX files on the CPU by OpenVINO, repeatable across machines and loads."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import reduce
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.networks.inference_packages import compiled_network, import_openvino
from perception.networks.mapping import InputFormat
from perception.networks.weights_file import check_onnx
from uav_bt.errors import AnswerError, ValueRangeError, WeightsError
from uav_bt.types.arrays import Image

_SETTINGS: Final = {
    "PERFORMANCE_HINT": "LATENCY",
    "NUM_STREAMS": 1,
    # Some virtual machines announce bfloat16 units and refuse to run them. Also, results must not
    # depend on the machine's preferred precision.
    "INFERENCE_PRECISION_HINT": "f32",
    # With pinning, all workers of a campaign would share one core.
    "ENABLE_CPU_PINNING": False,
}
_GREY: Final = 127  # of the image of the first run, which is slow


class OnnxNetwork:
    """A network of an ONNX file: one image at a time in, arrays out.

    It is read, prepared (`take_images`), and compiled with the outputs that are wanted. The same
    input always gives the same outputs, also under load. `size_px` is the width and height of its
    images, to which others are resized. A file that cannot be used is a WeightsError.
    """

    def __init__(self, path: Path, remedy: str) -> None:
        """Read the file; `remedy` is the command that makes one."""
        check_onnx(path, remedy)
        self.path = path
        try:
            self.model = import_openvino().Core().read_model(path)
        except (RuntimeError, UnicodeDecodeError) as error:  # the latter for names inside the file
            reason = str(error).strip().splitlines()[-1]
            raise self.refused(f"is not a readable ONNX network ({reason})") from error

    def refused(self, reason: str) -> WeightsError:
        """Return the error that this network cannot be used."""
        return WeightsError(self.path, reason)

    def about(self, name: str) -> str | None:
        """Return a text of the file's metadata."""
        key = ["framework", name]  # where OpenVINO keeps it
        return self.model.get_rt_info(key).astype(str) if self.model.has_rt_info(key) else None

    def outputs(self) -> dict[str, Any]:
        """Return the outputs by all their names, in order; at least one."""
        if not self.model.outputs:
            raise self.refused("the network has no output")
        return {
            name: port.get_node().input_value(0)
            for at, port in enumerate(self.model.outputs)
            for name in port.get_names() or (f"{at}",)
        }

    def take_images(self, wanted: InputFormat) -> tuple[int, int]:
        """Let the network take uint8 RGB images, 1xHxWx3, and return their width and height.

        That is faster than converting them first. An open size becomes that of the format.
        """
        self.size_px = self._sized(wanted)
        openvino = import_openvino()
        default = 255.0 if self.model.input(0).get_element_type().is_real() else 1.0
        steps = openvino.preprocess.PrePostProcessor(self.model)
        bytes_by_row = openvino.Layout("NHWC")
        steps.input().tensor().set_element_type(openvino.Type.u8).set_layout(bytes_by_row)
        steps.input().model().set_layout(openvino.Layout(wanted.layout.upper()))
        work = steps.input().preprocess().convert_element_type(openvino.Type.f32)
        if any(wanted.mean):
            work.mean(list(wanted.mean))
        work.scale(list(wanted.scale or (default,) * 3))
        if wanted.colours == "bgr":
            work.reverse_channels()
        self.model = steps.build()
        return self.size_px

    def _sized(self, wanted: InputFormat) -> tuple[int, int]:
        planar = wanted.layout == "nchw"
        channels, rows, columns = (1, 2, 3) if planar else (3, 1, 2)
        if len(self.model.inputs) != 1:
            raise self.refused(f"the network must have one input, it has {len(self.model.inputs)}")
        shape = self.model.input(0).get_partial_shape()
        given, form = str(shape), "1x3xHxW" if planar else "1xHxWx3"
        misfit = self.refused(f"the input must be {form}, got {given}")
        if len(shape) != 4:
            raise misfit
        width_px, height_px = wanted.size or (None, None)
        for axis, length in ((0, 1), (channels, 3), (columns, width_px), (rows, height_px)):
            if shape[axis].is_dynamic and length is not None:
                shape[axis] = length
        if shape.is_dynamic:
            raise self.refused(
                f"the input {given} leaves its size open; add `input: {{size: [WIDTH, HEIGHT]}}` "
                "to the network's mapping file"
            )
        if shape[channels] != 3 or shape[0] != 1:
            raise misfit
        if self.model.is_dynamic():
            self.model.reshape(shape)
        size_px = shape[columns].get_length(), shape[rows].get_length()
        if wanted.size not in (None, size_px):
            raise self.refused(
                f"the network takes images of {size_px[0]}x{size_px[1]}, the mapping says "
                f"{width_px}x{height_px}; remove `size` from the mapping"
            )
        return size_px

    def compile(
        self, outputs: Sequence[Any], threads: int, *, class_axis: int | None = None
    ) -> list[NDArray[Any]]:
        """Compile the network, and return its outputs for a first, grey input.

        Along `class_axis`, 1 or 3, the first output has scores of classes. It becomes the number of
        the best class, 1x1xHxW int32 (the lowest on a tie), which is faster inside.
        """
        if threads < 1:
            raise ValueRangeError(f"inference needs at least one thread, got {threads}")
        openvino = import_openvino()
        ops = openvino.opset13
        reals = [
            each if each.get_element_type().is_real() else ops.convert(each, "f32").output(0)
            for each in outputs
        ]
        checks = []
        for each in reals:
            axes = ops.constant(np.arange(len(each.get_partial_shape())))
            checks.append(ops.reduce_logical_and(ops.is_finite(each), axes, keep_dims=False))
        finite = reduce(ops.logical_and, checks)
        wanted = list(outputs)
        if class_axis is not None:
            # Along the second axis the first of equal scores is taken, along others not always.
            planes = ops.constant(np.array([0, 3, 1, 2]))
            scores = ops.transpose(reals[0], planes) if class_axis == 3 else reals[0]
            size = [each.get_length() for each in reals[0].get_partial_shape()]
            shape = [1, 1, *(size[1:3] if class_axis == 3 else size[2:])]
            one = ops.constant(np.int64(1))
            # Of four axes OpenVINO 2026.4 gives wrong numbers after a sum on processors with AVX2.
            flat = ops.reshape(scores, ops.constant(np.array([0, 0, -1])), special_zero=True)
            best = ops.topk(flat, one, 1, "max", "none", index_element_type="i32")
            wanted[0] = ops.reshape(best.output(1), ops.constant(shape), False).output(0)
        results = [ops.result(each) for each in (*wanted, finite)]
        name = self.model.get_friendly_name()
        model = openvino.Model(results, self.model.get_parameters(), name)
        settings = {**_SETTINGS, "INFERENCE_NUM_THREADS": threads}
        try:
            compiled = compiled_network(model, self.path, settings)
        except RuntimeError as error:
            lines = str(error).strip().splitlines()
            reason = next((line for line in lines if "node" in line.split(" ")), lines[-1])
            raise self.refused(
                f"OpenVINO cannot run this network ({reason.strip()}); export it with other "
                "operators"
            ) from error
        self._request = compiled.create_infer_request()
        for tensor in self._request.input_tensors:
            tensor.data[:] = _GREY
        self._request.infer()
        return self._answer()[:-1]

    def run(self, rgb: Image) -> list[NDArray[Any]]:
        """Return the outputs for an image, (H, W, 3) uint8 RGB; the next run overwrites them.

        AnswerError if an output holds NaN or infinity.
        """
        return self.infer([np.ascontiguousarray(shrunk(rgb, self.size_px)[None])])

    def infer(self, inputs: Sequence[Any] | Mapping[str, Any]) -> list[NDArray[Any]]:
        """Return the outputs for inputs, in order or by name; as `run`."""
        self._request.infer(inputs)
        *answer, finite = self._answer()
        if not finite:
            raise AnswerError(self.path, "the network's answer holds NaN or infinity")
        return answer

    def _answer(self) -> list[NDArray[Any]]:
        return [np.asarray(tensor.data) for tensor in self._request.output_tensors]


def shrunk(rgb: Image, size_px: tuple[int, int]) -> Image:
    """Return an image, (H, W, 3), resized (never cropped) to width and height of a network's input.

    Each pixel is the mean of its area, within one grey level: a box filter, then interpolation.
    OpenCV's `INTER_AREA` takes three times as long if the ratio of the sizes is not an integer.
    """
    if rgb.shape[1::-1] == size_px:
        return rgb
    height, width = rgb.shape[:2]
    window = (_odd(width / size_px[0]), _odd(height / size_px[1]))
    if window != (1, 1):
        rgb = cv2.blur(rgb, window)  # type: ignore[assignment]  # uint8 in, uint8 out
    return np.asarray(cv2.resize(rgb, size_px, interpolation=cv2.INTER_LINEAR), dtype=np.uint8)


def _odd(ratio: float) -> int:
    """Return the odd number nearest to a ratio; 1 up to 2.0, where interpolation is the mean."""
    return 1 if ratio <= 2.0 else 2 * round((ratio - 1.0) / 2.0) + 1
