"""Networks in 8-bit integers: half the time on a CPU, a quarter of the file.

What a convolution reads is rounded to one of 256 levels between the extremes seen on pictures, its
weights to levels of their own in every output channel, and its bias makes good what that shifts on
average (Nagel et al., arXiv 1906.04721). The graph says so with ONNX's own pairs of QuantizeLinear
and DequantizeLinear, which any runtime reads; OpenVINO turns them into integer convolutions.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from perception.networks.onnx_graph import import_onnx, write_onnx
from perception.networks.onnx_runtime import (
    compile_model,
    model_of_bytes,
    shrunk,
    taking_pictures,
)
from uav_bt.errors import ShapeError

__all__ = ["quantized", "write_network"]

_CONVOLUTIONS: Final = {"Conv": 0, "ConvTranspose": 1}  # and the axis of their weights' outputs
# These pass numbers on as they are: what leaves them has the levels of what went in.
_PASSING: Final = frozenset({"Concat", "MaxPool", "Pad"})
_LEVELS: Final = 255
# Of weights, 7 bits. Processors without VNNI add two products of 8 bits in 16, which overflow
# unless one factor has a bit less; so every processor gives the same answer.
_WEIGHT_LEVELS: Final = 63
_CORRECTED_ON: Final = 40  # pictures; means over all their pixels need no more

Ranges = dict[str, tuple[float, float]]


def quantized(model: Any, pictures: NDArray[np.uint8]) -> Any:
    """Return the 8-bit network of a float one.

    Args:
        model: of `GraphWriter.model`; it is left alone.
        pictures: (N, H, W, 3) RGB of the network's size, such as it will see: what lies beyond
            their extremes is clipped.

    Returns:
        A model with the same input and output, both still float32.

    Raises:
        ShapeError: the pictures are of another size, or there are none.
        MissingDependencyError: the package onnx is absent.
    """
    height, width = _size(model)
    if pictures.ndim != 4 or pictures.shape[1:] != (height, width, 3) or not len(pictures):
        raise ShapeError("pictures", expected=f"Nx{height}x{width}x3", actual=pictures.shape)
    coarse = _Rounding(model, _ranges(model, pictures)).model()
    _correct_biases(coarse, model, pictures[:: -(-len(pictures) // _CORRECTED_ON)])
    return coarse


def write_network(
    model: Any,
    path: Path,
    weights: Path,
    *,
    notes: Mapping[str, str],
    calibration: Iterable[NDArray[np.uint8]] | None,
) -> None:
    """Write a float network as it is, or in 8-bit integers where there are pictures to see how.

    Args:
        model: of `GraphWriter.model`.
        path: the ONNX file.
        weights: what the model was made from.
        notes: what else the file's metadata holds.
        calibration: pictures, (h, w, 3) RGB of any size; None for floats.

    Raises:
        ShapeError: there is no picture.
    """
    if calibration is None:
        write_onnx(model, path, weights, {**notes, "precision": "fp32"})
        return
    height, width = _size(model)
    seen = [shrunk(rgb, (width, height)) for rgb in calibration]
    pictures = np.stack(seen) if seen else np.zeros((0, height, width, 3), dtype=np.uint8)
    write_onnx(quantized(model, pictures), path, weights, {**notes, "precision": "int8"})


def _size(model: Any) -> tuple[int, int]:
    height, width = model.graph.input[0].type.tensor_type.shape.dim[2:]
    return height.dim_value, width.dim_value


# --- what is rounded ------------------------------------------------------------------------------


def _ranges(model: Any, pictures: NDArray[np.uint8]) -> Ranges:
    """Return least and greatest value of each tensor to round; of joined ones, those of all.

    The extremes are those of all pictures. Cutting off the rarest values, as is common, cuts off
    what is nearest to the drone.
    """
    groups = _sources(model)
    tensors = [name for group in groups for name in group]
    run = _runner(model, tensors)
    seen = np.array([[(t.min(), t.max()) for t in run(rgb)] for rgb in pictures], dtype=np.float64)
    extremes = dict(zip(tensors, seen.transpose(1, 0, 2), strict=True))
    ranges: Ranges = {}
    for group in groups:
        values = np.concatenate([extremes[name] for name in group])
        # Nought is a level of its own: borders are padded with it.
        ends = (min(0.0, float(values.min())), max(0.0, float(values.max())))
        ranges |= dict.fromkeys(group, ends)
    return ranges


def _sources(model: Any) -> list[list[str]]:
    """Return the tensors to round, in groups that share their levels because they are joined.

    A convolution's input is followed back through what only passes numbers on.
    """
    makers = {node.output[0]: node for node in model.graph.node}
    groups: list[set[str]] = []
    for node in model.graph.node:
        if node.op_type not in _CONVOLUTIONS:
            continue
        found, todo = set(), [node.input[0]]
        while todo:
            tensor = todo.pop()
            maker = makers.get(tensor)
            if maker is not None and maker.op_type in _PASSING:
                todo += maker.input if maker.op_type == "Concat" else maker.input[:1]
            else:
                found.add(tensor)
        touching = [group for group in groups if group & found]
        groups = [group for group in groups if not group & found]
        groups.append(found.union(*touching))
    return [sorted(group) for group in groups]


# --- the graph ------------------------------------------------------------------------------------


class _Rounding:
    """Writes a model anew, with rounded tensors and weights."""

    def __init__(self, model: Any, ranges: Ranges) -> None:
        self._onnx = import_onnx()
        self._model, self._ranges = model, ranges
        self._nodes: list[Any] = []
        self._constants: list[Any] = []

    def model(self) -> Any:
        """Return the new model."""
        arrays = self._onnx.numpy_helper
        copy = self._onnx.ModelProto()
        copy.CopyFrom(self._model)
        graph = copy.graph
        constants = {constant.name: constant for constant in graph.initializer}
        for node in graph.node:
            if node.op_type in _CONVOLUTIONS:
                weight = arrays.to_array(constants.pop(node.input[1]))
                self._weight(node.input[1], weight, _CONVOLUTIONS[node.op_type])
            rounded = [f"{name}.rounded" if name in self._ranges else name for name in node.input]
            node.input[:] = rounded
            self._nodes.append(node)
            if node.output[0] in self._ranges:
                self._tensor(node.output[0], *self._ranges[node.output[0]])
        nodes, kept = list(self._nodes), [*constants.values(), *self._constants]
        del graph.initializer[:], graph.node[:]
        graph.initializer.extend(kept)
        graph.node.extend(nodes)
        return copy

    def _tensor(self, name: str, low: float, high: float) -> None:
        step = np.maximum(np.float32((high - low) / _LEVELS), np.finfo(np.float32).tiny)
        zero = np.uint8(np.clip(np.rint(-low / step), 0, _LEVELS))
        scale = [self._constant(f"{name}.step", step), self._constant(f"{name}.zero", zero)]
        self._node("QuantizeLinear", f"{name}.levels", [name, *scale])
        self._node("DequantizeLinear", f"{name}.rounded", [f"{name}.levels", *scale])

    def _weight(self, name: str, weight: NDArray[np.float32], axis: int) -> None:
        others = tuple(at for at in range(weight.ndim) if at != axis)
        greatest = np.abs(weight).max(axis=others, keepdims=True)
        steps = np.maximum(greatest / _WEIGHT_LEVELS, np.finfo(np.float32).tiny)
        parts = [
            self._constant(f"{name}.levels", np.rint(weight / steps).astype(np.int8)),
            self._constant(f"{name}.steps", steps.reshape(-1).astype(np.float32)),
        ]
        self._node("DequantizeLinear", name, parts, axis=axis)

    def _constant(self, name: str, value: Any) -> str:
        self._constants.append(self._onnx.numpy_helper.from_array(np.asarray(value), name))
        return name

    def _node(self, kind: str, output: str, inputs: list[str], **attributes: Any) -> None:
        made = self._onnx.helper.make_node(kind, inputs, [output], name=output, **attributes)
        self._nodes.append(made)


# --- what rounding shifts -------------------------------------------------------------------------


def _correct_biases(coarse: Any, model: Any, pictures: NDArray[np.uint8]) -> None:
    """Shift each bias, the first convolution's first, until its outputs are right on average."""
    arrays = import_onnx().numpy_helper
    constants = {constant.name: constant for constant in coarse.graph.initializer}
    convolutions = [node for node in model.graph.node if node.op_type in _CONVOLUTIONS]
    wanted = _channel_means(model, [node.output[0] for node in convolutions], pictures)
    for node, mean in zip(convolutions, wanted, strict=True):
        (got,) = _channel_means(coarse, [node.output[0]], pictures)
        bias = constants[node.input[2]]
        better = (arrays.to_array(bias) + mean - got).astype(np.float32)
        bias.CopyFrom(arrays.from_array(better, bias.name))


def _channel_means(
    model: Any, tensors: Sequence[str], pictures: NDArray[np.uint8]
) -> list[NDArray[np.float64]]:
    run = _runner(model, tensors)
    total = [np.zeros(1)] * len(tensors)
    for rgb in pictures:
        means = [tensor.mean(axis=(0, 2, 3), dtype=np.float64) for tensor in run(rgb)]
        total = [old + new for old, new in zip(total, means, strict=True)]
    return [each / len(pictures) for each in total]


def _runner(
    model: Any, tensors: Sequence[str]
) -> Callable[[NDArray[np.uint8]], list[NDArray[np.float32]]]:
    """Return a function from a picture to tensors of a model, (1, C, h, w) each."""
    onnx = import_onnx()
    copy = onnx.ModelProto()
    copy.CopyFrom(model)
    del copy.graph.output[:]
    float32 = onnx.TensorProto.FLOAT
    copy.graph.output.extend(
        onnx.helper.make_tensor_value_info(name, float32, None) for name in tensors
    )
    network = taking_pictures(model_of_bytes(copy.SerializeToString()))
    request = compile_model(network, threads=1).create_infer_request()

    def run(rgb: NDArray[np.uint8]) -> list[NDArray[np.float32]]:
        request.infer([np.ascontiguousarray(rgb[None])])
        return [np.asarray(request.get_output_tensor(at).data) for at in range(len(tensors))]

    return run
