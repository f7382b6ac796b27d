"""The adapted head inside the network: an ONNX file with the logits of three roles.

Features and, of a network with a second head, relative depth stay outputs of the file.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from perception.networks.inference_packages import import_onnx
from perception.networks.named import ROLES
from perception.segmentation.adaptation.head import MAX_MARGIN, GroundHead
from perception.segmentation.adaptation.role_network import (
    ADAPTED_FROM,
    DEPTH,
    FEATURES,
    LOGITS,
)
from uav_bt.errors import WeightsError
from uav_bt.files import write_whole

_INNER: Final = "logits_before_adaptation"
_WEIGHTS_HASH: Final = "weights_sha256"


def write_adapted(
    path: Path,
    base: Path,
    groups: Sequence[Sequence[int]],
    head: GroundHead,
    base_hash: str,
) -> None:
    """Write a network with an adapted head.

    The file of a network of roles states roles, and so it is loaded as one. That of a network of
    classes states the roles as its classes.

    Args:
        path: the ONNX file to write; replaced in one step.
        base: the ONNX file of the frozen network.
        groups: numbers of its classes by `ROLES`, as `OnnxRoleNetwork.groups`.
        head: the head.
        base_hash: SHA-256 of the file of the frozen network, for the metadata.

    Raises:
        WeightsError: the network has no features.
        MissingDependencyError: the package onnx is not installed.
    """
    onnx = import_onnx()
    model = onnx.load(str(base))
    graph = model.graph
    outputs = {each.name: each for each in graph.output}
    logits = LOGITS if LOGITS in outputs else graph.output[0].name
    shape = [axis.dim_value for axis in outputs[logits].type.tensor_type.shape.dim]
    features = FEATURES if FEATURES in outputs else _head_input(graph, logits, base)
    _rename(graph, logits, _INNER)
    nodes, constants = _nodes(onnx, features, groups, head, shape[2:])
    graph.node.extend(nodes)
    graph.initializer.extend(constants)
    del graph.output[:]
    kind, make = onnx.TensorProto.FLOAT, onnx.helper.make_tensor_value_info
    graph.output.append(make(LOGITS, kind, [1, len(ROLES), *shape[2:]]))
    if DEPTH in outputs:
        graph.output.append(outputs[DEPTH])
    # The features show in flight whether the place is the learned one.
    if features != FEATURES:
        graph.node.append(onnx.helper.make_node("Identity", [features], [FEATURES]))
    small = [1, len(head.weights), None, None]
    graph.output.append(outputs.get(FEATURES) or make(FEATURES, kind, small))
    metadata = _metadata(model) | {ADAPTED_FROM: base_hash}
    del model.metadata_props[:]
    onnx.helper.set_model_props(model, metadata)
    onnx.checker.check_model(model)
    write_whole(path, model.SerializeToString(deterministic=True))


def _metadata(model: Any) -> dict[str, str]:
    """Return the metadata of the adapted network: the base's, with the roles in place of classes.

    The hash of the base's weights is left out: the head has others.
    """
    kept = {each.key: each.value for each in model.metadata_props if each.key != _WEIGHTS_HASH}
    if "roles" not in kept:
        kept["classes"] = json.dumps(ROLES)
    return kept


def _head_input(graph: Any, logits: str, base: Path) -> str:
    """Return the name of the input of the last convolution before the logits."""
    makers = {name: node for node in graph.node for name in node.output}
    name = logits
    for _ in range(8):
        node = makers.get(name)
        if node is None:
            break
        if node.op_type == "Conv":
            return str(node.input[0])
        name = node.input[0]
    raise WeightsError(
        base, "has no output 'features', and its logits do not come from a convolution"
    )


def _rename(graph: Any, old: str, new: str) -> None:
    for node in graph.node:
        for names in (node.input, node.output):
            for index, name in enumerate(names):
                if name == old:
                    names[index] = new


def _nodes(
    onnx: Any,
    features: str,
    groups: Sequence[Sequence[int]],
    head: GroundHead,
    size: Sequence[int],
) -> tuple[list[Any], list[Any]]:
    make, constants = onnx.helper.make_node, []

    def constant(name: str, value: Any, kind: Any = np.float32) -> str:
        named = f"adapted_{name}"
        constants.append(onnx.numpy_helper.from_array(np.array(value, kind), named))
        return named

    nodes = []
    for role, group in zip(ROLES, groups, strict=True):
        chosen = constant(f"{role}_classes", group, np.int64)
        nodes += [
            make("Gather", [_INNER, chosen], [f"adapted_{role}_scores"], axis=1),
            make(
                "ReduceMax",
                [f"adapted_{role}_scores", constant(f"{role}_axis", [1], np.int64)],
                [f"adapted_{role}"],
                keepdims=1,
            ),
        ]
    outside, ground, obstacle = (f"adapted_{role}" for role in ROLES)
    weights = constant("weights", head.weights[None, :, None, None])
    target = constant("size", [1, 1, *size], np.int64)
    least, most = constant("least", -MAX_MARGIN), constant("most", MAX_MARGIN)
    nodes += [
        make("Max", [outside, obstacle], ["adapted_best"]),
        make("Sub", [ground, "adapted_best"], ["adapted_difference"]),
        make("Clip", ["adapted_difference", least, most], ["adapted_margin"]),
        make(
            "Mul", ["adapted_margin", constant("margin_weight", head.margin_weight)], ["adapted_m"]
        ),
        make("Conv", [features, weights, constant("bias", [head.bias])], ["adapted_small"]),
        make(
            "Resize",
            ["adapted_small", "", "", target],
            ["adapted_large"],
            mode="linear",
            coordinate_transformation_mode="half_pixel",
        ),
        make("Add", ["adapted_large", "adapted_m"], ["adapted_score"]),
        make("Sub", [outside, "adapted_best"], ["adapted_first"]),
        make("Sub", [obstacle, "adapted_best"], ["adapted_last"]),
        make("Concat", ["adapted_first", "adapted_score", "adapted_last"], [LOGITS], axis=1),
    ]
    return nodes, constants
