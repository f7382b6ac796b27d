"""Inference of ONNX files on the CPU by OpenVINO, repeatable across machines and loads."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final, Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.networks.compiled_networks import compiled_network
from perception.networks.inference_packages import import_openvino
from perception.networks.named import check_onnx
from uav_bt.errors import ValueRangeError, WeightsError

_ROLES: Final = ["framework", "roles"]
"""Where OpenVINO keeps the metadata of an ONNX file."""


def read_model(path: Path, remedy: str) -> Any:
    """Return the network of a file.

    Args:
        path: the ONNX file.
        remedy: command that makes the shipped file, for the message when the file is absent.

    Raises:
        WeightsError: the file is absent or no readable network.
    """
    check_onnx(path, remedy)
    try:
        return import_openvino().Core().read_model(path)
    except (RuntimeError, UnicodeDecodeError) as error:  # the latter for names inside the file
        reason = str(error).strip().splitlines()[-1]
        raise WeightsError(path, f"is not a readable ONNX network ({reason})") from error


def compile_model(model: Any, threads: int, path: Path) -> Any:
    """Return the network, compiled for one image at a time.

    Args:
        model: the network.
        threads: number of inference threads.
        path: its ONNX file, for the cache of compiled networks and for messages.

    Raises:
        ValueRangeError: `threads` is less than 1.
        WeightsError: the inference runtime cannot run the network.
    """
    if threads < 1:
        raise ValueRangeError(f"inference needs at least one thread, got {threads}")
    settings = {
        "PERFORMANCE_HINT": "LATENCY",
        "NUM_STREAMS": 1,
        "INFERENCE_NUM_THREADS": threads,
        # Some virtual machines announce bfloat16 units and refuse to run them. Also, results must
        # not depend on the machine's preferred precision.
        "INFERENCE_PRECISION_HINT": "f32",
        # With pinning, all workers of a campaign would share one core.
        "ENABLE_CPU_PINNING": False,
    }
    try:
        return compiled_network(model, path, settings)
    except RuntimeError as error:
        reason = next(
            (line for line in str(error).splitlines() if "node" in line.split(" ")),
            str(error).strip().splitlines()[-1],
        )
        raise WeightsError(
            path,
            f"OpenVINO cannot run this network ({reason.strip()}); export it with other operators",
        ) from error


def input_size(
    model: Any, path: Path, *, planar: bool = True, size_px: tuple[int, int] | None = None
) -> tuple[int, int]:
    """Return width and height of the network's input image, px.

    An open batch size is set to 1. Open width and height are set to `size_px`.

    Args:
        model: the network; changed in place.
        path: its file, for messages.
        planar: whether the input is 1x3xHxW; otherwise 1xHxWx3.
        size_px: width and height from the mapping file; None for those of the ONNX file.

    Raises:
        WeightsError: the network takes something else, or the size is unknown.
    """
    if len(model.inputs) != 1 or not model.outputs:
        raise WeightsError(path, f"the network must have one input, it has {len(model.inputs)}")
    shape = model.input(0).get_partial_shape()
    given = str(shape)
    wanted = "1x3xHxW" if planar else "1xHxWx3"
    if len(shape) != 4:
        raise WeightsError(path, f"the input must be {wanted}, got {given}")
    channels, rows, columns = (1, 2, 3) if planar else (3, 1, 2)
    open_axes = {0: 1, channels: 3}
    if size_px is not None:
        open_axes |= {columns: size_px[0], rows: size_px[1]}
    for axis, length in open_axes.items():
        if shape[axis].is_dynamic:
            shape[axis] = length
    if shape.is_dynamic:
        raise WeightsError(
            path,
            f"the input {given} leaves its size open; add `input: {{size: [WIDTH, HEIGHT]}}` to "
            "the network's mapping file",
        )
    if shape[channels] != 3 or shape[0] != 1:
        raise WeightsError(path, f"the input must be {wanted}, got {given}")
    if model.is_dynamic():
        model.reshape(shape)
    found_px = shape[columns].get_length(), shape[rows].get_length()
    if size_px is not None and found_px != size_px:
        raise WeightsError(
            path,
            f"the network takes images of {found_px[0]}x{found_px[1]}, the mapping says "
            f"{size_px[0]}x{size_px[1]}; remove `size` from the mapping",
        )
    return found_px


def accept_uint8(
    model: Any,
    *,
    planar: bool = True,
    mean: Sequence[float] = (0.0, 0.0, 0.0),
    scale: Sequence[float] | None = None,
    colours: Literal["rgb", "bgr"] = "rgb",
) -> Any:
    """Let a network take uint8 images, which is faster than converting them first.

    Args:
        model: the network; it has one input.
        planar: whether its input is 1x3xHxW; otherwise 1xHxWx3.
        mean: subtracted from the 0..255 colours, red green blue.
        scale: divides the difference. The default is 255 for an input of floats, and 1 for an input
            of integers, because such a network scales inside.
        colours: colour order of the network's input.

    Returns:
        The network with an input 1xHxWx3, uint8 RGB.
    """
    openvino = import_openvino()
    if scale is None:
        scale = (255.0,) * 3 if model.input(0).get_element_type().is_real() else (1.0,) * 3
    steps = openvino.preprocess.PrePostProcessor(model)
    bytes_by_row = openvino.Layout("NHWC")
    steps.input().tensor().set_element_type(openvino.Type.u8).set_layout(bytes_by_row)
    steps.input().model().set_layout(openvino.Layout("NCHW" if planar else "NHWC"))
    work = steps.input().preprocess().convert_element_type(openvino.Type.f32)
    if any(mean):
        work.mean(list(mean))
    work.scale(list(scale))
    if colours == "bgr":
        work.reverse_channels()
    return steps.build()


def is_room_network(model: Any) -> bool:
    """Return whether a network states roles instead of classes, in its metadata.

    Its second head gives depth in heights of the camera above the ground.
    """
    return bool(model.has_rt_info(_ROLES))


def only_output(model: Any, name: str) -> Any:
    """Return a network with one of its outputs; the network itself if it has one, or not that."""
    ports = [port for port in model.outputs if name in port.get_names()]
    if len(model.outputs) == 1 or not ports:
        return model
    openvino = import_openvino()
    result = openvino.opset13.result(ports[0].get_node().input_value(0))
    return openvino.Model([result], model.get_parameters(), model.get_friendly_name())


def class_numbers(model: Any, *, planar: bool = True) -> Any:
    """Add an argmax over the classes to a network; inside the network it is faster.

    Args:
        model: the network, with class scores as output.
        planar: whether its output is 1xCxHxW; otherwise 1xHxWxC.

    Returns:
        The network with two outputs: the number of the best class, 1x1xHxW int32 (the lowest number
        on a tie), and a bool, true if all scores are finite.
    """
    openvino = import_openvino()
    ops = openvino.opset13
    scores = model.output(0).get_node().input_value(0)
    if not planar:
        scores = ops.transpose(scores, ops.constant(np.array([0, 3, 1, 2])))
    if not scores.get_element_type().is_real():
        scores = ops.convert(scores, "f32")
    best = ops.topk(
        scores, ops.constant(np.int64(1)), 1, "max", "none", index_element_type="i32"
    ).output(1)
    axes = ops.constant(np.arange(4))
    sound = ops.reduce_logical_and(ops.is_finite(scores), axes, keep_dims=False)
    results = [ops.result(best), ops.result(sound)]
    return openvino.Model(results, model.get_parameters(), model.get_friendly_name())


def shrunk(rgb: NDArray[np.uint8], size_px: tuple[int, int]) -> NDArray[np.uint8]:
    """Return an image resized (never cropped) to the width and height of a network's input.

    Each pixel is the mean of its area in the original, within one grey level: first a box filter
    over a whole number of pixels, then linear interpolation. OpenCV's `INTER_AREA` takes three
    times as long if the ratio of the sizes is not an integer.

    Args:
        rgb: (H, W, 3) uint8.
        size_px: width and height of the result.
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
