"""The depth network as files: safetensors is the source of truth, ONNX is generated from it.

The graph is written node by node from the weights' names, with each batch norm folded into the
convolution before it. It needs neither torch nor a tracer, and the same weights always give the
same bytes.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from perception.weights_io import read_weights, write_weights
from uav_bt.errors import MissingDependencyError, WeightsError

__all__ = ["export_depth_onnx", "load_depth_tensors", "save_depth_net"]

_KIND: Final = "depth-network"
_CURE: Final = "`uav-bt train depth` makes them"
_OPSET: Final = 17
_IR_VERSION: Final = 9  # of that opset's time, so that older runtimes read the file too
_BATCH_NORM_EPSILON: Final = 1e-5  # torch's default
_DISPARITY_RANGE, _DISPARITY_FLOOR = 10.0, 0.01  # `network`'s, which imports torch

Tensors = Mapping[str, NDArray[np.float32]]


def save_depth_net(path: Path, net: Any, *, notes: Mapping[str, Any]) -> None:
    """Write the network's weights.

    Args:
        path: the safetensors file.
        net: a `network.DepthNet` (not named in the signature: this module imports without torch).
        notes: how it was trained, anything JSON can hold.
    """
    tensors = {
        name: tensor.detach().numpy()
        for name, tensor in net.state_dict().items()
        if not name.endswith("num_batches_tracked")
    }
    details = {"config": asdict(net.config), "notes": dict(notes)}
    write_weights(path, tensors, kind=_KIND, details=details)


def load_depth_tensors(path: Path) -> tuple[dict[str, NDArray[np.float32]], dict[str, Any]]:
    """Return the weights by name and the details (`config`, `notes`).

    Raises:
        WeightsError: the file is absent, damaged or something else.
    """
    tensors, details = read_weights(path, kind=_KIND, cure=_CURE)
    broken = [name for name, tensor in tensors.items() if not np.isfinite(tensor).all()]
    if broken:
        raise WeightsError(path, f"the weights hold NaN or infinity ({broken[0]}); {_CURE}")
    return tensors, details


def export_depth_onnx(weights: Path, onnx_path: Path) -> None:
    """Generate the ONNX file of the weights; replaced in one step.

    Input `image`: (1, 3, H, W) float32 RGB in [0, 1]. Output `depth`: (1, 1, H/2, W/2) float32. The
    file's metadata holds the SHA-256 of the weights it was made from.

    Raises:
        WeightsError: the weights are absent, damaged or lack a tensor.
        MissingDependencyError: the package onnx is absent.
    """
    try:
        import onnx  # noqa: PLC0415 (only the training extra has it)
    except ModuleNotFoundError as error:
        raise MissingDependencyError("writing ONNX needs: pip install 'uav-bt[train]'") from error
    tensors, details = load_depth_tensors(weights)
    try:
        config = details["config"]
        model = _Graph(onnx, tensors).model(
            levels=len(config["channels"]),
            size=(int(config["height_px"]), int(config["width_px"])),
        )
    except KeyError as error:
        raise WeightsError(weights, f"lacks {error}; {_CURE}") from error
    notes = {"weights_sha256": hashlib.sha256(weights.read_bytes()).hexdigest()}
    onnx.helper.set_model_props(model, notes)
    onnx.checker.check_model(model, full_check=True)
    partial = onnx_path.with_name(onnx_path.name + ".part")
    partial.write_bytes(model.SerializeToString(deterministic=True))
    partial.replace(onnx_path)


class _Graph:
    """Collects the nodes of `network.DepthNet`, in its order."""

    def __init__(self, onnx: Any, tensors: Tensors) -> None:
        self._onnx = onnx
        self._tensors = tensors
        self._nodes: list[Any] = []
        self._constants: list[Any] = []

    def model(self, *, levels: int, size: tuple[int, int]) -> Any:
        """Return the whole model."""
        helper, kind = self._onnx.helper, self._onnx.TensorProto.FLOAT
        half = self._constant("half", np.float32(0.5))
        features = self._halve("stem", self._node("Sub", "centred", ["image", half]))
        skips = []
        for level in range(levels - 1):
            features = self._halve(f"down.{level}.0", features)
            features = self._residual(f"down.{level}.1", features)
            skips.append(features)
        skips.pop()
        self._constant("twice", np.array([1, 1, 2, 2], dtype=np.float32))
        self._constant("border", np.array([0, 0, 1, 1, 0, 0, 1, 1], dtype=np.int64))
        for level in range(levels - 2):
            features = self._merge(f"up.{level}", features, skips.pop())
        spread = self._node(
            # Torch's PixelShuffle is ONNX's column-row-depth order.
            *("DepthToSpace", "spread", [self._reflected("head", features)]),
            blocksize=2,
            mode="CRD",
        )
        disparity = self._node("Sigmoid", "disparity", [spread])
        range_ = self._constant("range", np.float32(_DISPARITY_RANGE))
        floor = self._constant("floor", np.float32(_DISPARITY_FLOOR))
        scaled = self._node("Mul", "scaled", [disparity, range_])
        self._node("Reciprocal", "depth", [self._node("Add", "floored", [scaled, floor])])
        height, width = size
        graph = helper.make_graph(
            self._nodes,
            "depth",
            [helper.make_tensor_value_info("image", kind, [1, 3, height, width])],
            [helper.make_tensor_value_info("depth", kind, [1, 1, height // 2, width // 2])],
            self._constants,
        )
        return helper.make_model(
            graph,
            opset_imports=[helper.make_opsetid("", _OPSET)],
            ir_version=_IR_VERSION,
            producer_name="uav-bt",
        )

    # --- the network's parts ----------------------------------------------------------------------

    def _halve(self, name: str, features: str) -> str:
        pad = self._tensors[f"{name}.0.weight"].shape[-1] // 2
        halved = self._normed(f"{name}.0", f"{name}.1", features, pads=[pad] * 4, strides=[2, 2])
        return self._node("Relu", f"{name}.relu", [halved])

    def _residual(self, name: str, features: str) -> str:
        inner = self._normed(f"{name}.inner.0", f"{name}.inner.1", features, pads=[1] * 4)
        inner = self._node("Relu", f"{name}.inner.relu", [inner])
        inner = self._normed(f"{name}.inner.3", f"{name}.inner.4", inner, pads=[1] * 4)
        summed = self._node("Add", f"{name}.sum", [features, inner])
        return self._node("Relu", f"{name}.relu", [summed])

    def _merge(self, name: str, features: str, skip: str) -> str:
        narrow = self._node("Conv", f"{name}.narrow", [features, *self._weights(f"{name}.narrow")])
        grown = self._node(
            *("Resize", f"{name}.grown", [narrow, "", "twice"]),
            mode="nearest",
            nearest_mode="floor",
            coordinate_transformation_mode="asymmetric",
        )
        summed = self._node("Add", f"{name}.sum", [grown, skip])
        return self._node("Elu", f"{name}.elu", [self._reflected(f"{name}.conv", summed)])

    def _reflected(self, name: str, features: str) -> str:
        """Convolve with a border that mirrors the picture."""
        padded = self._node("Pad", f"{name}.pad", [features, "border"], mode="reflect")
        return self._node("Conv", name, [padded, *self._weights(name)])

    def _normed(self, convolution: str, norm: str, features: str, **shape: Any) -> str:
        def tensor(name: str) -> NDArray[np.float64]:
            return self._tensors[name].astype(np.float64)

        deviation = np.sqrt(tensor(f"{norm}.running_var") + _BATCH_NORM_EPSILON)
        gain = tensor(f"{norm}.weight") / deviation
        weight = tensor(f"{convolution}.weight") * gain[:, None, None, None]
        bias = tensor(f"{norm}.bias") - tensor(f"{norm}.running_mean") * gain
        inputs = [
            features,
            self._constant(f"{convolution}.weight", weight.astype(np.float32)),
            self._constant(f"{convolution}.bias", bias.astype(np.float32)),
        ]
        return self._node("Conv", convolution, inputs, **shape)

    # --- ONNX -------------------------------------------------------------------------------------

    def _weights(self, name: str) -> list[str]:
        return [
            self._constant(f"{name}.{part}", self._tensors[f"{name}.{part}"])
            for part in ("weight", "bias")
        ]

    def _constant(self, name: str, value: Any) -> str:
        self._constants.append(self._onnx.numpy_helper.from_array(np.asarray(value), name))
        return name

    def _node(self, kind: str, output: str, inputs: list[str], **attributes: Any) -> str:
        self._nodes.append(
            self._onnx.helper.make_node(kind, inputs, [output], name=output, **attributes)
        )
        return output
