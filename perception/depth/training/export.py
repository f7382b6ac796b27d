"""The depth network as files: safetensors is the source of truth, ONNX is generated from it.

It imports without torch.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from perception.networks.onnx_graph import GraphWriter
from perception.networks.quantization import write_network
from perception.networks.weights import load_tensors, save_network
from uav_bt.errors import WeightsError

__all__ = ["export_depth_onnx", "load_depth_tensors", "save_depth_net"]

_KIND: Final = "depth-network"
_CURE: Final = "`uav-bt train depth` makes them"
_DISPARITY_RANGE, _DISPARITY_FLOOR = 10.0, 0.01  # `network`'s, which imports torch


def save_depth_net(path: Path, net: Any, *, notes: Mapping[str, Any]) -> None:
    """Write the weights of a `network.DepthNet`, with notes on how it was trained."""
    save_network(path, net, kind=_KIND, details={"notes": dict(notes)})


def load_depth_tensors(path: Path) -> tuple[dict[str, NDArray[np.float32]], dict[str, Any]]:
    """Return the weights by name and the details (`config`, `notes`).

    Raises:
        WeightsError: the file is absent, damaged or something else.
    """
    return load_tensors(path, kind=_KIND, cure=_CURE)


def export_depth_onnx(
    weights: Path, onnx_path: Path, *, calibration: Iterable[NDArray[np.uint8]] | None = None
) -> None:
    """Generate the ONNX file of the weights; replaced in one step.

    Input `image`: (1, 3, H, W) float32 RGB in [0, 1]. Output `depth`: (1, 1, H/2, W/2) float32. The
    file's metadata holds the SHA-256 of the weights it was made from, and what the network computes
    in: `fp32` or `int8`.

    Args:
        weights: the safetensors file.
        onnx_path: the file to write.
        calibration: pictures, (h, w, 3) RGB of any size, that say what numbers the network meets:
            it then computes in 8-bit integers. None for floats.

    Raises:
        WeightsError: the weights are absent, damaged or lack a tensor.
        ShapeError: there is no picture to calibrate on.
        MissingDependencyError: the package onnx is absent.
    """
    tensors, details = load_depth_tensors(weights)
    try:
        config = details["config"]
        size = (int(config["height_px"]), int(config["width_px"]))
        model = _Graph(tensors).model(levels=len(config["channels"]), size=size)
    except KeyError as error:
        raise WeightsError(weights, f"lacks {error}; {_CURE}") from error
    write_network(model, onnx_path, weights, notes={}, calibration=calibration)


class _Graph(GraphWriter):
    """Collects the nodes of `network.DepthNet`, in its order."""

    def model(self, *, levels: int, size: tuple[int, int]) -> Any:
        """Return the whole model."""
        half = self.constant("half", np.float32(0.5))
        features = self._halve("stem", self.node("Sub", "centred", ["image", half]))
        skips = []
        for level in range(levels - 1):
            features = self._halve(f"down.{level}.0", features)
            features = self._residual(f"down.{level}.1", features)
            skips.append(features)
        skips.pop()
        self.constant("twice", np.array([1, 1, 2, 2], dtype=np.float32))
        self.constant("border", np.array([0, 0, 1, 1, 0, 0, 1, 1], dtype=np.int64))
        for level in range(levels - 2):
            features = self._merge(f"up.{level}", features, skips.pop())
        spread = self.node(
            # Torch's PixelShuffle is ONNX's column-row-depth order.
            *("DepthToSpace", "spread", [self._reflected("head", features)]),
            blocksize=2,
            mode="CRD",
        )
        disparity = self.node("Sigmoid", "disparity", [spread])
        range_ = self.constant("range", np.float32(_DISPARITY_RANGE))
        floor = self.constant("floor", np.float32(_DISPARITY_FLOOR))
        scaled = self.node("Mul", "scaled", [disparity, range_])
        self.node("Reciprocal", "depth", [self.node("Add", "floored", [scaled, floor])])
        height, width = size
        return self.finish("depth", "depth", size=size, shape=(1, height // 2, width // 2))

    # --- the network's parts ----------------------------------------------------------------------

    def _halve(self, name: str, features: str) -> str:
        pad = self.kernel(f"{name}.0") // 2
        halved = self.normed(f"{name}.0", f"{name}.1", features, pads=[pad] * 4, strides=[2, 2])
        return self.node("Relu", f"{name}.relu", [halved])

    def _residual(self, name: str, features: str) -> str:
        inner = self.normed(f"{name}.inner.0", f"{name}.inner.1", features, pads=[1] * 4)
        inner = self.node("Relu", f"{name}.inner.relu", [inner])
        inner = self.normed(f"{name}.inner.3", f"{name}.inner.4", inner, pads=[1] * 4)
        summed = self.node("Add", f"{name}.sum", [features, inner])
        return self.node("Relu", f"{name}.relu", [summed])

    def _merge(self, name: str, features: str, skip: str) -> str:
        narrow = self.node("Conv", f"{name}.narrow", [features, *self.weights(f"{name}.narrow")])
        grown = self.node(
            *("Resize", f"{name}.grown", [narrow, "", "twice"]),
            mode="nearest",
            nearest_mode="floor",
            coordinate_transformation_mode="asymmetric",
        )
        summed = self.node("Add", f"{name}.sum", [grown, skip])
        return self.node("Elu", f"{name}.elu", [self._reflected(f"{name}.conv", summed)])

    def _reflected(self, name: str, features: str) -> str:
        """Convolve with a border that mirrors the picture."""
        padded = self.node("Pad", f"{name}.pad", [features, "border"], mode="reflect")
        return self.node("Conv", name, [padded, *self.weights(name)])
