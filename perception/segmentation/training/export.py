"""The U-Net as files: safetensors is the source of truth, the ONNX graph is generated from it.

It imports without torch.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from perception.networks.onnx_graph import GraphWriter
from perception.networks.quantization import write_network
from perception.networks.weights import load_tensors, save_network
from uav_bt.classes import CLASS_NAMES
from uav_bt.errors import WeightsError

__all__ = ["export_onnx", "load_unet_tensors", "save_unet"]

_KIND: Final = "segmentation-unet"
_CURE: Final = "`uav-bt train segmentation` makes them"


def save_unet(path: Path, net: Any, *, notes: Mapping[str, Any]) -> None:
    """Write the weights of a `unet.UNet`, with notes on how it was trained."""
    save_network(
        path, net, kind=_KIND, details={"classes": list(CLASS_NAMES), "notes": dict(notes)}
    )


def load_unet_tensors(path: Path) -> tuple[dict[str, NDArray[np.float32]], dict[str, Any]]:
    """Return the weights by name and the details (`config`, `classes`, `notes`).

    Raises:
        WeightsError: the file is absent, damaged or something else.
    """
    return load_tensors(path, kind=_KIND, cure=_CURE)


def export_onnx(
    weights: Path, onnx_path: Path, *, calibration: Iterable[NDArray[np.uint8]] | None = None
) -> None:
    """Generate the ONNX file of the weights; replaced in one step.

    Input `image`: (1, 3, H, W) float32 RGB in [0, 1]. Output `logits`: (1, 17, H, W) float32. The
    file's metadata names the classes, the SHA-256 of the weights it was made from, and what the
    network computes in: `fp32` or `int8`.

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
    tensors, details = load_unet_tensors(weights)
    try:
        config = details["config"]
        size = (int(config["height_px"]), int(config["width_px"]))
        model = _Graph(tensors).model(
            channels=tuple(config["channels"]), outputs=int(config["outputs"]), size=size
        )
    except KeyError as error:
        raise WeightsError(weights, f"lacks {error}; {_CURE}") from error
    notes = {"classes": json.dumps(list(CLASS_NAMES))}
    write_network(model, onnx_path, weights, notes=notes, calibration=calibration)


class _Graph(GraphWriter):
    """Collects the nodes of the U-Net of `unet.UNet`, in its order."""

    def model(self, *, channels: tuple[int, ...], outputs: int, size: tuple[int, int]) -> Any:
        """Return the whole model."""
        features = self.node("Sub", "centred", ["image", self.constant("half", np.float32(0.5))])
        skips = []
        for level in range(len(channels)):
            if level:
                features = self.node(
                    "MaxPool", f"pool{level}", [features], kernel_shape=[2, 2], strides=[2, 2]
                )
            features = self._block(f"down.{level}", features)
            skips.append(features)
        skips.pop()
        for level in range(len(channels) - 1):
            inputs = [features, *self.weights(f"up.{level}")]
            grown = self.node("ConvTranspose", f"up.{level}", inputs, strides=[2, 2])
            joined = self.node("Concat", f"join.{level}", [grown, skips.pop()], axis=1)
            features = self._block(f"merge.{level}", joined)
        scores = self.node("Conv", "head", [features, *self.weights("head")])
        # Torch's PixelShuffle is ONNX's column-row-depth order.
        self.node("DepthToSpace", "logits", [scores], blocksize=2, mode="CRD")
        return self.finish("unet", "logits", size=size, shape=(outputs, *size))

    def _block(self, name: str, features: str) -> str:
        for convolution, norm in ((0, 1), (3, 4)):
            here = f"{name}.{convolution}"
            halves = self.kernel(here) == 6  # the first convolution of `unet.UNet`
            shape = {"pads": [2] * 4, "strides": [2, 2]} if halves else {"pads": [1] * 4}
            summed = self.normed(here, f"{name}.{norm}", features, **shape)
            features = self.node("Relu", f"{here}.relu", [summed])
        return features
