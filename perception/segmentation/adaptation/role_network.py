"""Networks that give each pixel scores of three roles and features, for adaptation to a place."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Protocol

import numpy as np
from numpy.typing import NDArray

from perception.networks.inference_packages import import_openvino
from perception.networks.named import ROLES
from perception.networks.onnx_runtime import (
    accept_uint8,
    compile_model,
    input_size,
    read_model,
    shrunk,
)
from uav_bt.errors import ShapeError, WeightsError
from uav_bt.lab.classes import LabClasses
from uav_bt.lab.roles import ROLE_NAMES
from uav_bt.types.arrays import Image

_ROLES_KEY: Final = ["framework", "roles"]  # where OpenVINO keeps an ONNX file's metadata
_CLASSES_KEY: Final = ["framework", "classes"]
LOGITS: Final = "logits"
DEPTH: Final = "depth"
FEATURES: Final = "features"
ADAPTED_FROM: Final = "adapted_from"
"""Key of the metadata of an adapted network: the hash of the network that was adapted."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RoleView:
    """Outputs of a network for one image.

    Attributes:
        scores: (3, H, W) float32, logits of `ROLES`.
        features: (C, h, w) float32; h and w divide H and W.
        depth: (h, w) float32, in heights of the camera above the ground; None without a second
            head.
    """

    scores: NDArray[np.float32]
    features: NDArray[np.float32]
    depth: NDArray[np.float32] | None = None

    def __post_init__(self) -> None:
        if self.scores.ndim != 3 or len(self.scores) != len(ROLES) or self.features.ndim != 3:
            raise ShapeError(
                "scores and features of a network",
                expected="3xHxW and Cxhxw",
                actual=(*self.scores.shape, *self.features.shape),
            )


class RoleNetwork(Protocol):
    """A frozen network: an image in, scores of the roles and features out."""

    def infer(self, rgb: Image) -> RoleView:
        """Return scores and features of an image, (H, W, 3) uint8 RGB of any size."""
        ...


def classes_by_role(stated: Sequence[str], classes: LabClasses | None) -> list[list[int]]:
    """Return the numbers of a network's classes by `ROLES`.

    Args:
        stated: names of the network's classes: those of `ROLES`, or of the lab's classes.
        classes: classes of the lab; None for a network by roles.

    Raises:
        ShapeError: a role has no class.
    """
    if classes is None:
        roles = list(stated)
    else:
        numbers = classes.roles(np.arange(len(classes), dtype=np.uint8))
        known = dict(zip(classes.names, numbers, strict=True))
        roles = [ROLE_NAMES[known[name]] if name in known else name for name in stated]
    counted = [ROLES[2] if role == "mark" else role for role in roles]
    found = [[at for at, each in enumerate(counted) if each == role] for role in ROLES]
    if not all(found):
        raise ShapeError(
            "classes of a network by role", expected="1 or more each", actual=tuple(map(len, found))
        )
    return found


class OnnxRoleNetwork:
    """A network in an ONNX file with the outputs `logits` and `features`, run by OpenVINO.

    A file without `features` is accepted if its logits come from a 1x1 convolution: the features
    are the input of that convolution. Depth comes from the output `depth`, if there is one.

    Args:
        path: the ONNX file.
        classes: classes of the lab whose network it is; None for a network by roles.
        threads: number of inference threads.

    Raises:
        WeightsError: the file is absent, or has neither such outputs nor such a convolution.
    """

    def __init__(self, path: Path, classes: LabClasses | None = None, *, threads: int = 1) -> None:
        self.path = path
        model = read_model(path, "`uav-bt lab train`")
        self.groups = _groups(model, path, classes)
        self._size = input_size(model, path)
        model = accept_uint8(model)
        logits = _output(model, LOGITS) or model.output(0)
        features, depth = _output(model, FEATURES), _output(model, DEPTH)
        inner = _head_input(logits, path) if features is None else _source(features)
        ops = import_openvino().opset13
        results = [ops.result(_source(logits)), ops.result(inner)]
        if depth is not None:
            results.append(ops.result(_source(depth)))
        self._has_depth = depth is not None
        asked = import_openvino().Model(results, model.get_parameters(), model.get_friendly_name())
        self._request = compile_model(asked, threads, path).create_infer_request()

    def infer(self, rgb: Image) -> RoleView:
        """Return scores and features of an image, (H, W, 3) uint8 RGB of any size."""
        self._request.infer([np.ascontiguousarray(shrunk(rgb, self._size)[None])])
        logits, features, *depth = (
            np.array(self._request.get_output_tensor(index).data[0], np.float32)
            for index in range(3 if self._has_depth else 2)
        )
        scores = np.stack([logits[group].max(axis=0) for group in self.groups])
        return RoleView(scores=scores, features=features, depth=depth[0][0] if depth else None)


def _groups(model: Any, path: Path, classes: LabClasses | None) -> list[list[int]]:
    for key, of_lab in ((_ROLES_KEY, None), (_CLASSES_KEY, classes)):
        if model.has_rt_info(key):
            stated = json.loads(model.get_rt_info(key).astype(str))
            try:
                return classes_by_role(stated, of_lab)
            except ShapeError as error:
                raise WeightsError(path, f"cannot be adapted: {error}") from error
    raise WeightsError(path, "states neither roles nor classes in its metadata")


def _output(model: Any, name: str) -> Any:
    return next((each for each in model.outputs if name in each.get_names()), None)


def _source(output: Any) -> Any:
    """Return the value that a result hands out."""
    return output.get_node().input_value(0)


def _head_input(logits: Any, path: Path) -> Any:
    """Return the input of the last convolution before the logits."""
    node = _source(logits).get_node()
    for _ in range(8):
        if node.get_type_name() == "Convolution":
            return node.input_value(0)
        if not node.inputs():
            break
        node = node.input_value(0).get_node()
    raise WeightsError(
        path, "has no output 'features', and its logits do not come from a convolution"
    )
