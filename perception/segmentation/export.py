"""The U-Net as files: safetensors is the source of truth, the ONNX graph is generated from it.

The graph is written node by node from the weights' names, with each batch norm folded into the
convolution before it. It needs neither torch nor a tracer, and the same weights always give the
same bytes.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from perception.classes import CLASS_NAMES
from perception.weights_io import read_weights, write_weights
from uav_bt.errors import MissingDependencyError, WeightsError

__all__ = ["export_onnx", "load_unet_tensors", "save_unet"]

_KIND: Final = "segmentation-unet"
_CURE: Final = "`uav-bt train segmentation` makes them"
_OPSET: Final = 17
_IR_VERSION: Final = 9  # of that opset's time, so that older runtimes read the file too
_BATCH_NORM_EPSILON: Final = 1e-5  # torch's default

Tensors = Mapping[str, NDArray[np.float32]]


def save_unet(path: Path, net: Any, *, notes: Mapping[str, Any]) -> None:
    """Write the network's weights.

    Args:
        path: the safetensors file.
        net: a `unet.UNet` (not named in the signature: this module must import without torch).
        notes: how it was trained, anything JSON can hold.
    """
    tensors = {
        name: tensor.detach().numpy()
        for name, tensor in net.state_dict().items()
        if not name.endswith("num_batches_tracked")
    }
    details = {"config": asdict(net.config), "classes": list(CLASS_NAMES), "notes": dict(notes)}
    write_weights(path, tensors, kind=_KIND, details=details)


def load_unet_tensors(path: Path) -> tuple[dict[str, NDArray[np.float32]], dict[str, Any]]:
    """Return the weights by name and the details (`config`, `classes`, `notes`).

    Raises:
        WeightsError: the file is absent, damaged or something else.
    """
    tensors, details = read_weights(path, kind=_KIND, cure=_CURE)
    broken = [name for name, tensor in tensors.items() if not np.isfinite(tensor).all()]
    if broken:
        raise WeightsError(path, f"the weights hold NaN or infinity ({broken[0]}); {_CURE}")
    return tensors, details


def export_onnx(weights: Path, onnx_path: Path) -> None:
    """Generate the ONNX file of the weights; replaced in one step.

    Input `image`: (1, 3, H, W) float32 RGB in [0, 1]. Output `logits`: (1, 17, H, W) float32. The
    file's metadata names the classes and the SHA-256 of the weights it was made from.

    Raises:
        WeightsError: the weights are absent, damaged or lack a tensor.
        MissingDependencyError: the package onnx is absent.
    """
    try:
        import onnx  # noqa: PLC0415 (only the training extra has it)
    except ModuleNotFoundError as error:
        raise MissingDependencyError("writing ONNX needs: pip install 'uav-bt[train]'") from error
    tensors, details = load_unet_tensors(weights)
    try:
        config = details["config"]
        model = _Graph(onnx, tensors).model(
            channels=tuple(config["channels"]),
            outputs=int(config["outputs"]),
            size=(int(config["height_px"]), int(config["width_px"])),
        )
    except KeyError as error:
        raise WeightsError(weights, f"lacks {error}; {_CURE}") from error
    notes = {
        "classes": json.dumps(list(CLASS_NAMES)),
        "weights_sha256": hashlib.sha256(weights.read_bytes()).hexdigest(),
    }
    onnx.helper.set_model_props(model, notes)
    onnx.checker.check_model(model, full_check=True)
    partial = onnx_path.with_name(onnx_path.name + ".part")
    partial.write_bytes(model.SerializeToString(deterministic=True))
    partial.replace(onnx_path)


class _Graph:
    """Collects the nodes of the U-Net of `unet.UNet`, in its order."""

    def __init__(self, onnx: Any, tensors: Tensors) -> None:
        self._onnx = onnx
        self._tensors = tensors
        self._nodes: list[Any] = []
        self._constants: list[Any] = []

    def model(self, *, channels: tuple[int, ...], outputs: int, size: tuple[int, int]) -> Any:
        """Return the whole model."""
        helper, kind = self._onnx.helper, self._onnx.TensorProto.FLOAT
        features = self._node("Sub", "centred", ["image", self._constant("half", np.float32(0.5))])
        skips = []
        for level in range(len(channels)):
            if level:
                features = self._node(
                    "MaxPool", f"pool{level}", [features], kernel_shape=[2, 2], strides=[2, 2]
                )
            features = self._block(f"down.{level}", features)
            skips.append(features)
        skips.pop()
        for level in range(len(channels) - 1):
            inputs = [features, *self._weights(f"up.{level}")]
            grown = self._node("ConvTranspose", f"up.{level}", inputs, strides=[2, 2])
            joined = self._node("Concat", f"join.{level}", [grown, skips.pop()], axis=1)
            features = self._block(f"merge.{level}", joined)
        scores = self._node("Conv", "head", [features, *self._weights("head")])
        # Torch's PixelShuffle is ONNX's column-row-depth order.
        self._node("DepthToSpace", "logits", [scores], blocksize=2, mode="CRD")
        graph = helper.make_graph(
            self._nodes,
            "unet",
            [helper.make_tensor_value_info("image", kind, [1, 3, *size])],
            [helper.make_tensor_value_info("logits", kind, [1, outputs, *size])],
            self._constants,
        )
        return helper.make_model(
            graph,
            opset_imports=[helper.make_opsetid("", _OPSET)],
            ir_version=_IR_VERSION,
            producer_name="uav-bt",
        )

    def _block(self, name: str, features: str) -> str:
        for convolution, norm in ((0, 1), (3, 4)):
            here = f"{name}.{convolution}"
            weight, bias = self._folded(here, f"{name}.{norm}")
            inputs = [
                features,
                self._constant(f"{here}.weight", weight),
                self._constant(f"{here}.bias", bias),
            ]
            halves = weight.shape[-1] == 6  # the first convolution of `unet.UNet`
            shape = {"pads": [2] * 4, "strides": [2, 2]} if halves else {"pads": [1] * 4}
            summed = self._node("Conv", here, inputs, **shape)
            features = self._node("Relu", f"{here}.relu", [summed])
        return features

    def _folded(
        self, convolution: str, norm: str
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        def tensor(name: str) -> NDArray[np.float64]:
            return self._tensors[name].astype(np.float64)

        deviation = np.sqrt(tensor(f"{norm}.running_var") + _BATCH_NORM_EPSILON)
        gain = tensor(f"{norm}.weight") / deviation
        weight = tensor(f"{convolution}.weight") * gain[:, None, None, None]
        bias = tensor(f"{norm}.bias") - tensor(f"{norm}.running_mean") * gain
        return weight.astype(np.float32), bias.astype(np.float32)

    def _weights(self, name: str) -> list[str]:
        return [
            self._constant(f"{name}.{part}", self._tensors[f"{name}.{part}"])
            for part in ("weight", "bias")
        ]

    def _constant(self, name: str, value: NDArray[np.float32] | np.float32) -> str:
        self._constants.append(self._onnx.numpy_helper.from_array(np.asarray(value), name))
        return name

    def _node(self, kind: str, output: str, inputs: list[str], **attributes: Any) -> str:
        self._nodes.append(
            self._onnx.helper.make_node(kind, inputs, [output], name=output, **attributes)
        )
        return output
