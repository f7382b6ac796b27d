"""Depth estimators for flight: any ONNX network on the CPU, run by OpenVINO."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from perception.depth.mapping import depth_mapping
from perception.networks.named import SHIPPED_DEPTHS, depth_file
from perception.networks.onnx_runtime import (
    accept_uint8,
    compile_model,
    input_size,
    is_room_network,
    only_output,
    read_model,
    shrunk,
)
from uav_bt.errors import AnswerError, UnknownNameError, WeightsError
from uav_bt.types import DepthMap, Frame

_MAX_DEPTH: Final = 1e4  # for a disparity of zero, in the network's unit


class OnnxDepthEstimator:
    """A depth network in an ONNX file.

    The network has one input image, (1, 3, H, W) RGB in [0, 1] or as in its mapping file, and one
    output (1, 1, h, w) or (1, h, w), h and w at most H and W. Of several outputs `depth` is used.
    The output is relative depth along the optical axis, or disparity, which is inverted. The same
    frame always gives the same depth, also under load.

    Args:
        path: the ONNX file; for the mapping file beside it see `depth_mapping`.
        threads: number of inference threads.

    Raises:
        WeightsError: the file is absent or damaged, its output is not a depth map, or it is unknown
            whether it gives depth or disparity.
        FileError: the mapping file beside it is malformed.
    """

    def __init__(self, path: Path, *, threads: int = 1) -> None:
        self._path = path
        model = read_model(path, "`uav-bt net train depth`")
        mapping = depth_mapping(path, model)
        self._in_heights = is_room_network(model)
        model = only_output(model, "depth")
        self._inverse = mapping.output == "disparity"
        wanted = mapping.input
        planar = wanted.layout == "nchw"
        self._size = input_size(model, path, planar=planar, size_px=wanted.size)
        model = accept_uint8(
            model, planar=planar, mean=wanted.mean, scale=wanted.scale, colours=wanted.colours
        )
        self._request = compile_model(model, threads, path).create_infer_request()
        grey = np.full((self._size[1], self._size[0], 3), 127, dtype=np.uint8)
        self._output_px = self._check_output(self._run(grey))

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height of the network's input, px; frames are resized to them."""
        return self._size

    def estimate(self, frame: Frame) -> DepthMap:
        """Return the relative depth of a frame, at the size of the network's output.

        Raises:
            AnswerError: the network's output is not finite or not positive.
        """
        depth = self.depth(frame.image)
        return DepthMap(
            depth=depth,
            metric=False,
            captured_s=frame.captured_s,
            in_heights=self._in_heights,
        )

    def depth(self, rgb: NDArray[np.uint8]) -> NDArray[np.float32]:
        """Return relative depth, (h, w) float32, positive, of an image, (H, W, 3) uint8 RGB."""
        output = self._run(shrunk(rgb, self._size)).reshape(self._output_px[::-1])
        if not np.isfinite(output).all():
            raise AnswerError(self._path, "the network's answer holds NaN or infinity")
        if output.min() < 0.0 or (output.min() == 0.0 and not self._inverse):
            meant = "disparity" if self._inverse else "depth"
            raise AnswerError(self._path, f"a {meant} must be positive, and one is not")
        if self._inverse:
            return np.asarray(1.0 / np.maximum(output, 1.0 / _MAX_DEPTH), dtype=np.float32)
        return np.array(output, dtype=np.float32)  # a copy: the next frame overwrites the tensor

    def _run(self, rgb: NDArray[np.uint8]) -> NDArray[Any]:
        self._request.infer([np.ascontiguousarray(rgb[None])])
        return np.asarray(self._request.get_output_tensor(0).data)

    def _check_output(self, output: NDArray[Any]) -> tuple[int, int]:
        planar = output.ndim == 3 or (output.ndim == 4 and output.shape[1] == 1)
        if not planar or output.shape[0] != 1 or min(output.shape[-2:]) < 2:
            raise WeightsError(
                self._path, f"the output must be 1x1xHxW or 1xHxW, got {output.shape}"
            )
        height, width = output.shape[-2:]
        if width > self._size[0] or height > self._size[1]:
            raise WeightsError(
                self._path,
                f"the output must not be larger than the input {self._size[0]}x{self._size[1]}, "
                f"got {width}x{height}",
            )
        return width, height


def load_depth_estimator(model: str | Path, *, threads: int = 1) -> OnnxDepthEstimator:
    """Return a shipped depth network by its name, or the network of an ONNX file.

    Args:
        model: "depth" (8-bit integers), "any", or a path that ends in .onnx.
        threads: number of inference threads.

    Raises:
        UnknownNameError: the name is unknown.
        FileError: the mapping file beside the network is malformed.
        WeightsError: the file cannot be used, or it is unknown whether it gives depth or disparity.
    """
    path = depth_file(str(model))
    if path is None:
        raise UnknownNameError("depth network", str(model), (*SHIPPED_DEPTHS, "FILE.onnx"))
    return OnnxDepthEstimator(path, threads=threads)
