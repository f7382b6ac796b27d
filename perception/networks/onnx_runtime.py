"""ONNX files on the CPU, by OpenVINO: the same answer on every machine and beside other work."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from uav_bt.errors import WeightsError

__all__ = ["compile_model", "input_size", "read_model", "shrunk"]


def read_model(path: Path, cure: str) -> Any:
    """Return the network of a file.

    Args:
        path: the ONNX file.
        cure: what makes the shipped one, for the message when there is no such file.

    Raises:
        WeightsError: the file is absent or no network.
    """
    # Imported here: a mission that flies on something else need not wait for it.
    import openvino  # noqa: PLC0415

    if not path.is_file():
        raise WeightsError(path, f"there is no such network; {cure} makes the shipped one")
    try:
        return openvino.Core().read_model(path)
    except RuntimeError as error:
        reason = str(error).strip().splitlines()[-1]
        raise WeightsError(path, f"is not a readable ONNX network ({reason})") from error


def compile_model(model: Any, threads: int) -> Any:
    """Return the network, ready to be asked for one picture at a time."""
    import openvino  # noqa: PLC0415

    settings = {
        "PERFORMANCE_HINT": "LATENCY",
        "NUM_STREAMS": 1,
        "INFERENCE_NUM_THREADS": threads,
        # Some virtual machines announce bfloat16 units that they do not let one use; and answers
        # must not depend on the machine's favourite precision.
        "INFERENCE_PRECISION_HINT": "f32",
        # Pinned, the workers of a campaign would all sit on the same core.
        "ENABLE_CPU_PINNING": False,
    }
    return openvino.Core().compile_model(model, "CPU", settings)


def input_size(model: Any, path: Path, *, planar: bool = True) -> tuple[int, int]:
    """Return width and height of the one picture that the network takes; its batch becomes one.

    Args:
        model: the network.
        path: its file, for messages.
        planar: 1x3xHxW; otherwise 1xHxWx3.

    Raises:
        WeightsError: it takes something else.
    """
    if len(model.inputs) != 1 or not model.outputs:
        raise WeightsError(path, f"the network must have one input, it has {len(model.inputs)}")
    shape = model.input(0).get_partial_shape()
    if shape.is_dynamic and len(shape) == 4 and shape[0].is_dynamic:
        shape[0] = 1
        model.reshape(shape)
    wanted = "1x3xHxW" if planar else "1xHxWx3"
    if shape.is_dynamic or len(shape) != 4 or shape[1 if planar else 3] != 3 or shape[0] != 1:
        raise WeightsError(path, f"the input must be {wanted} of fixed size, got {shape}")
    height, width = (shape[2], shape[3]) if planar else (shape[1], shape[2])
    return width.get_length(), height.get_length()


def shrunk(rgb: NDArray[np.uint8], size_px: tuple[int, int]) -> NDArray[np.uint8]:
    """Return a picture resized (never cropped) to the width and height of a network's input."""
    if rgb.shape[1::-1] == size_px:
        return rgb
    return np.asarray(cv2.resize(rgb, size_px, interpolation=cv2.INTER_AREA), dtype=np.uint8)
