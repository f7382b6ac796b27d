"""The control student in flight: an ONNX file on the CPU, run by OpenVINO."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from perception.control.ego_state import OUTPUTS, VERSION, ControlNetConfig, state_size
from perception.networks.onnx_runtime import OnnxNetwork, shrunk
from perception.networks.weights_file import SHIPPED_WEIGHTS
from uav_bt.errors import ValueRangeError

SHIPPED_STUDENT: Final = SHIPPED_WEIGHTS / "student.onnx"

_COMMAND: Final = "`uav-bt net train student`"


@dataclass(frozen=True, kw_only=True)
class ControlEstimate:
    """The network's prediction for a decision."""

    advance: float  # 0 to 1: probability of an advance, not a turn
    clockwise: float  # 0 to 1: probability that a turn is clockwise
    step_m: float  # length of an advance
    ground_ends: float  # 0 to 1: probability that the ground ends ahead
    free_m: float  # length of the path ahead free of obstacles, up to a step


def decode(prediction: NDArray[np.floating[Any]]) -> ControlEstimate:
    """Return the estimate from the network's outputs, (5,), `ego_state.OUTPUTS`."""
    advance, clockwise, step_m, ends, free_m = (float(value) for value in prediction)
    return ControlEstimate(
        advance=_sigmoid(advance),
        clockwise=_sigmoid(clockwise),
        step_m=step_m,
        ground_ends=_sigmoid(ends),
        free_m=free_m,
    )


def _sigmoid(logit: float) -> float:
    return float(1.0 / (1.0 + np.exp(-np.clip(logit, -50.0, 50.0))))


class OnnxControlStudent:
    """A control student in an ONNX file from `uav-bt net export student`.

    Raises:
        WeightsError: the file is absent, damaged, of another version, or not a control student.
    """

    def __init__(self, path: Path = SHIPPED_STUDENT, *, threads: int = 1) -> None:
        self._network = network = OnnxNetwork(path, _COMMAND)
        self.config = config = _config_of(network)
        self.size_px = config.width_px, config.height_px
        """Width and height of the network's images, px."""
        model = network.model
        ports = {port.any_name: port for port in (*model.inputs, *model.outputs)}
        for name, shape in {
            "frames": (1, config.views, 3, config.height_px, config.width_px),
            "state": (1, state_size(config.views)),
            "prediction": (1, len(OUTPUTS)),
        }.items():
            got = ports[name].get_partial_shape() if name in ports else None
            if got is None or got.is_dynamic or tuple(got.to_shape()) != shape:
                raise network.refused(f"'{name}' must be {'x'.join(map(str, shape))}, got {got}")
        network.compile([network.outputs()["prediction"]], threads)

    def preprocess(self, rgb: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Return an image, (H, W, 3) RGB, at the network's size: resized, never cropped."""
        return shrunk(rgb, self.size_px)

    def estimate(
        self, images: Sequence[NDArray[np.uint8]], state: NDArray[np.float32]
    ) -> ControlEstimate:
        """Return the network's prediction for a decision.

        The images are V from `preprocess`, the present one first, and the state is their
        `state_vector`. ValueRangeError: it is not finite; AnswerError: the prediction is not.
        """
        # The network's layers would turn NaN into zero without an error.
        if not np.isfinite(state).all():
            raise ValueRangeError(
                f"the state must be finite numbers, got {state.tolist()}; look at telemetry"
            )
        planes = np.stack(images).transpose(0, 3, 1, 2)
        frames = np.ascontiguousarray(planes, dtype=np.float32) / 255.0
        (prediction,) = self._network.infer({"frames": frames[None], "state": state[None]})
        return decode(prediction.reshape(-1))


def _config_of(network: OnnxNetwork) -> ControlNetConfig:
    about = network.about("control")
    if about is None:
        raise network.refused(f"is not a control student; {_COMMAND} makes one")
    try:
        stated = json.loads(about)
        if stated["version"] != VERSION:
            raise network.refused(
                f"expected a student of version {VERSION}, got {stated['version']}; train it anew: "
                f"{_COMMAND}"
            )
        return ControlNetConfig.from_json(stated["config"])
    except (KeyError, TypeError, ValueError) as error:
        raise network.refused(f"does not say what it is ({error}); {_COMMAND} makes one") from error
