"""ONNX graphs written node by node from the weights' names.

Each batch norm is folded into the convolution before it. It needs neither torch nor a tracer, and
the same weights always give the same bytes.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from uav_bt.errors import MissingDependencyError
from uav_bt.files import write_whole

__all__ = ["GraphWriter", "Tensors", "import_onnx", "write_onnx"]

_OPSET: Final = 17
_IR_VERSION: Final = 9  # of that opset's time, so that older runtimes read the file too
_BATCH_NORM_EPSILON: Final = 1e-5  # torch's default

Tensors = Mapping[str, NDArray[np.float32]]


def import_onnx() -> Any:
    """Return the package onnx.

    Raises:
        MissingDependencyError: it is absent.
    """
    try:
        import onnx  # noqa: PLC0415 (only the training extra has it)
    except ModuleNotFoundError as error:
        raise MissingDependencyError("writing ONNX needs: pip install 'uav-bt[train]'") from error
    return onnx


def write_onnx(model: Any, path: Path, weights: Path, notes: Mapping[str, str]) -> None:
    """Check a model and write it in one step.

    Args:
        model: of `GraphWriter.model`.
        path: the ONNX file.
        weights: what it was made from; the file's metadata holds their SHA-256.
        notes: what else the metadata holds.
    """
    onnx = import_onnx()
    digest = hashlib.sha256(weights.read_bytes()).hexdigest()
    onnx.helper.set_model_props(model, {**notes, "weights_sha256": digest})
    onnx.checker.check_model(model, full_check=True)
    write_whole(path, model.SerializeToString(deterministic=True))


class GraphWriter:
    """Collects the nodes of a network in the order of its module; the base of one for each."""

    def __init__(self, tensors: Tensors) -> None:
        self._onnx = import_onnx()
        self._tensors = tensors
        self._nodes: list[Any] = []
        self._constants: list[Any] = []

    def finish(
        self, name: str, output: str, *, size: tuple[int, int], shape: tuple[int, int, int]
    ) -> Any:
        """Return the model: `image`, (1, 3, H, W), to one output.

        Args:
            name: of the graph.
            output: the node that is the output.
            size: H and W of the input.
            shape: channels, height and width of the output.
        """
        helper, kind = self._onnx.helper, self._onnx.TensorProto.FLOAT
        graph = helper.make_graph(
            self._nodes,
            name,
            [helper.make_tensor_value_info("image", kind, [1, 3, *size])],
            [helper.make_tensor_value_info(output, kind, [1, *shape])],
            self._constants,
        )
        return helper.make_model(
            graph,
            opset_imports=[helper.make_opsetid("", _OPSET)],
            ir_version=_IR_VERSION,
            producer_name="uav-bt",
        )

    def normed(self, convolution: str, norm: str, features: str, **shape: Any) -> str:
        """Convolve with the batch norm folded in."""

        def tensor(name: str) -> NDArray[np.float64]:
            return self._tensors[name].astype(np.float64)

        deviation = np.sqrt(tensor(f"{norm}.running_var") + _BATCH_NORM_EPSILON)
        gain = tensor(f"{norm}.weight") / deviation
        weight = tensor(f"{convolution}.weight") * gain[:, None, None, None]
        bias = tensor(f"{norm}.bias") - tensor(f"{norm}.running_mean") * gain
        inputs = [
            features,
            self.constant(f"{convolution}.weight", weight.astype(np.float32)),
            self.constant(f"{convolution}.bias", bias.astype(np.float32)),
        ]
        return self.node("Conv", convolution, inputs, **shape)

    def kernel(self, name: str) -> int:
        """Return the width of a convolution's kernel."""
        return int(self._tensors[f"{name}.weight"].shape[-1])

    def weights(self, name: str) -> list[str]:
        """Return weight and bias of a layer as constants."""
        return [
            self.constant(f"{name}.{part}", self._tensors[f"{name}.{part}"])
            for part in ("weight", "bias")
        ]

    def constant(self, name: str, value: Any) -> str:
        """Add a constant and return its name."""
        self._constants.append(self._onnx.numpy_helper.from_array(np.asarray(value), name))
        return name

    def node(self, kind: str, output: str, inputs: list[str], **attributes: Any) -> str:
        """Add a node and return its output's name, which is its own, too."""
        self._nodes.append(
            self._onnx.helper.make_node(kind, inputs, [output], name=output, **attributes)
        )
        return output
