"""Depth estimators for flight: any ONNX network on the CPU, run by OpenVINO."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from perception.networks.mapping import DepthMapping, read_depth_mapping
from perception.networks.onnx_runtime import OnnxNetwork
from perception.networks.weights_file import SHIPPED_DEPTHS, depth_file
from uav_bt.errors import AnswerError, UnknownNameError
from uav_bt.types import DepthMap, Frame

_MAX_DEPTH: Final = 1e4  # for a disparity of zero, in the network's unit


class OnnxDepthEstimator:
    """A depth network in an ONNX file, with a mapping file beside it unless it is ours.

    The network has one input image, (1, 3, H, W) RGB in [0, 1] or as in its mapping file, and one
    output (1, 1, h, w) or (1, h, w), h and w at most H and W. Of several outputs `depth` is used.
    The output is relative depth along the optical axis, or disparity, which is inverted.
    """

    def __init__(self, path: Path, *, threads: int = 1) -> None:
        self._network = network = OnnxNetwork(path, "`uav-bt net train depth`")
        mapping = read_depth_mapping(path)
        if mapping is None:
            if network.about("weights_sha256") is None:  # which `uav-bt net train` writes
                raise network.refused(
                    "does not say whether it gives depth or disparity (1/depth), and the two "
                    "exchange near and far; write `output: depth` or `output: disparity` into "
                    f"{path.with_suffix('.yaml')}"
                )
            mapping = DepthMapping(output="depth")
        self._inverse = mapping.output == "disparity"
        self._in_heights = network.about("roles") is not None  # the second head of `any`
        self.size_px = network.take_images(mapping.input)
        outputs = network.outputs()
        chosen = outputs.get("depth", next(iter(outputs.values())))
        shape = network.compile([chosen], threads)[0].shape
        if len(shape) not in (3, 4) or set(shape[:-2]) != {1} or min(shape[-2:]) < 2:
            raise network.refused(f"the output must be 1x1xHxW or 1xHxW, got {shape}")
        if shape[-1] > self.size_px[0] or shape[-2] > self.size_px[1]:
            raise network.refused(
                f"the output must not be larger than the input {self.size_px[0]}x"
                f"{self.size_px[1]}, got {shape[-1]}x{shape[-2]}"
            )

    def estimate(self, frame: Frame) -> DepthMap:
        """Return the relative depth of a frame, at the size of the network's output.

        Raises:
            AnswerError: the network's output is not finite or not positive.
        """
        return DepthMap(
            depth=self.depth(frame.image),
            metric=False,
            captured_s=frame.captured_s,
            in_heights=self._in_heights,
        )

    def depth(self, rgb: NDArray[np.uint8]) -> NDArray[np.float32]:
        """Return relative depth, (h, w) float32, positive, of an image, (H, W, 3) uint8 RGB."""
        (output,) = self._network.run(rgb)
        output = output.reshape(output.shape[-2:])
        if output.min() < 0.0 or (output.min() == 0.0 and not self._inverse):
            meant = "disparity" if self._inverse else "depth"
            raise AnswerError(self._network.path, f"a {meant} must be positive, and one is not")
        if self._inverse:
            return np.asarray(1.0 / np.maximum(output, 1.0 / _MAX_DEPTH), dtype=np.float32)
        return np.array(output, dtype=np.float32)  # a copy: the next frame overwrites the output


def load_depth_estimator(model: str | Path, *, threads: int = 1) -> OnnxDepthEstimator:
    """Return a shipped depth network by its name, `depth` or `any`, or that of an ONNX file."""
    path = depth_file(str(model))
    if path is None:
        raise UnknownNameError("depth network", str(model), (*SHIPPED_DEPTHS, "FILE.onnx"))
    return OnnxDepthEstimator(path, threads=threads)
