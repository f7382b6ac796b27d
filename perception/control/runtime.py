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
from uav_bt.errors import ShapeError, ValueRangeError, WeightsError

SHIPPED_STUDENT: Final = SHIPPED_WEIGHTS / "student.onnx"

_COMMAND: Final = "`uav-bt net train student`"
_ABOUT: Final = ["framework", "control"]  # where OpenVINO keeps an ONNX file's metadata


@dataclass(frozen=True, kw_only=True)
class ControlEstimate:
    """What the network predicts for a moment."""

    advance: float  # 0 to 1: to go on rather than turn
    clockwise: float  # 0 to 1: the side to turn to, if it turns
    step_m: float  # of the advance
    ground_ends: float  # 0 to 1
    free_m: float  # how far the way ahead is free of obstacles, up to a step


def decode(prediction: NDArray[np.floating[Any]]) -> ControlEstimate:
    """Return the meaning of the network's outputs, (5,): `config.OUTPUTS`."""
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
    """A control student in an ONNX file, as `uav-bt net export student` makes it.

    Args:
        path: the ONNX file.
        threads: of inference.

    Raises:
        WeightsError: the file is absent, damaged, of another version, or no control student.
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
        # The first inference is the slow one.
        self._run(np.zeros(self._frames, np.float32), np.zeros(self._state, np.float32))

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height of the network's images."""
        return self.config.width_px, self.config.height_px

    def preprocess(self, rgb: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Return an image, (H, W, 3) RGB, at the network's size: resized, never cropped."""
        return shrunk(rgb, self.size_px)

    def estimate(
        self, images: Sequence[NDArray[np.uint8]], state: NDArray[np.float32]
    ) -> ControlEstimate:
        """Return what the network predicts for a moment.

        Args:
            images: V of (h, w, 3) uint8 RGB, from `preprocess`; the present one first.
            state: (S,) float32, `ego_state.state_vector` of that moment.

        Raises:
            ShapeError: there are too few or too many of them, or of another size.
            ValueRangeError: a number of the state is not finite.
            WeightsError: the network answered with something that is not a number.
        """
        frames = np.stack(images)
        _, views, channels, height, width = self._frames
        if frames.shape != (views, height, width, channels):
            expected = f"{views}x{height}x{width}x{channels}"
            raise ShapeError("views", expected=expected, actual=frames.shape)
        if state.shape != self._state[1:]:
            raise ShapeError("state vector", expected=str(self._state[1]), actual=state.shape)
        # The network's own layers turn NaN into zero, unnoticed.
        if not np.isfinite(state).all():
            raise ValueRangeError(
                f"the state must be finite numbers, got {state.tolist()}; look at telemetry"
            )
        planes = np.ascontiguousarray(frames.transpose(0, 3, 1, 2), dtype=np.float32) / 255.0
        prediction = self._run(planes[None], state[None])
        if not np.isfinite(prediction).all():
            raise WeightsError(self._path, "the network's answer holds NaN or infinity")
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
        raise WeightsError(path, f"is no control student; {_COMMAND} makes one")
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
