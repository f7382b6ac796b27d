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
from perception.networks.onnx_runtime import compile_model, read_model, shrunk
from perception.networks.weights_file import SHIPPED_WEIGHTS
from uav_bt.errors import AnswerError, ShapeError, ValueRangeError, WeightsError

SHIPPED_STUDENT: Final = SHIPPED_WEIGHTS / "student.onnx"

_COMMAND: Final = "`uav-bt net train student`"
_ABOUT: Final = ["framework", "control"]  # where OpenVINO keeps an ONNX file's metadata


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

    Args:
        path: the ONNX file.
        threads: number of inference threads.

    Raises:
        WeightsError: the file is absent, damaged, of another version, or not a control student.
    """

    def __init__(self, path: Path = SHIPPED_STUDENT, *, threads: int = 1) -> None:
        self._path = path
        model = read_model(path, _COMMAND)
        self.config = _config_of(model, path)
        config = self.config
        self._frames = (1, config.views, 3, config.height_px, config.width_px)
        self._state = (1, state_size(config.views))
        self._check(model)
        self._request = compile_model(model, threads, path).create_infer_request()
        # Warm-up: the first inference is slow.
        self._run(np.zeros(self._frames, np.float32), np.zeros(self._state, np.float32))

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height of the network's images, px."""
        return self.config.width_px, self.config.height_px

    def preprocess(self, rgb: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Return an image, (H, W, 3) RGB, at the network's size: resized, never cropped."""
        return shrunk(rgb, self.size_px)

    def estimate(
        self, images: Sequence[NDArray[np.uint8]], state: NDArray[np.float32]
    ) -> ControlEstimate:
        """Return the network's prediction for a decision.

        Args:
            images: V images (h, w, 3) uint8 RGB, from `preprocess`; the present one first.
            state: (S,) float32, `ego_state.state_vector` of that decision.

        Raises:
            ShapeError: an argument has another number or size.
            ValueRangeError: a number of the state is not finite.
            AnswerError: an output of the network is not finite.
        """
        frames = np.stack(images)
        _, views, channels, height, width = self._frames
        if frames.shape != (views, height, width, channels):
            expected = f"{views}x{height}x{width}x{channels}"
            raise ShapeError("views", expected=expected, actual=frames.shape)
        if state.shape != self._state[1:]:
            raise ShapeError("state vector", expected=str(self._state[1]), actual=state.shape)
        # The network's layers would turn NaN into zero without an error.
        if not np.isfinite(state).all():
            raise ValueRangeError(
                f"the state must be finite numbers, got {state.tolist()}; look at telemetry"
            )
        planes = np.ascontiguousarray(frames.transpose(0, 3, 1, 2), dtype=np.float32) / 255.0
        prediction = self._run(planes[None], state[None])
        if not np.isfinite(prediction).all():
            raise AnswerError(self._path, "the network's answer holds NaN or infinity")
        return decode(prediction)

    def _run(self, frames: NDArray[np.float32], state: NDArray[np.float32]) -> NDArray[np.float32]:
        self._request.infer({"frames": frames, "state": state})
        return np.asarray(self._request.get_output_tensor(0).data).reshape(-1).copy()

    def _check(self, model: Any) -> None:
        ports = {port.any_name: port for port in (*model.inputs, *model.outputs)}
        expected = {
            "frames": self._frames,
            "state": self._state,
            "prediction": (1, len(OUTPUTS)),
        }
        for name, shape in expected.items():
            got = ports[name].get_partial_shape() if name in ports else None
            if got is None or got.is_dynamic or tuple(got.to_shape()) != shape:
                raise WeightsError(
                    self._path, f"'{name}' must be {'x'.join(map(str, shape))}, got {got}"
                )


def _config_of(model: Any, path: Path) -> ControlNetConfig:
    if not model.has_rt_info(_ABOUT):
        raise WeightsError(path, f"is not a control student; {_COMMAND} makes one")
    try:
        about = json.loads(model.get_rt_info(_ABOUT).astype(str))
        if about["version"] != VERSION:
            raise WeightsError(
                path,
                f"expected a student of version {VERSION}, got {about['version']}; train it anew: "
                f"{_COMMAND}",
            )
        return ControlNetConfig.from_json(about["config"])
    except (KeyError, TypeError, ValueError) as error:
        raise WeightsError(
            path, f"does not say what it is ({error}); {_COMMAND} makes one"
        ) from error
