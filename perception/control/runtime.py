"""The control student in flight: an ONNX file on the CPU, run by OpenVINO."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from perception.control.config import OUTPUTS, VERSION, ControlNetConfig
from perception.control.situation import situation_size
from perception.networks.onnx_runtime import compile_model, read_model, shrunk
from perception.networks.weights_file import SHIPPED_WEIGHTS
from uav_bt.errors import ShapeError, ValueRangeError, WeightsError

__all__ = ["SHIPPED_STUDENT", "ControlEstimate", "OnnxControlStudent", "meaning"]

SHIPPED_STUDENT: Final = SHIPPED_WEIGHTS / "student.onnx"

_CURE: Final = "`uav-bt net train student`"
_ABOUT: Final = ["framework", "control"]  # where OpenVINO keeps an ONNX file's metadata
_LEAST_ADVANCE_M: Final = 0.15  # of a movement: half the rules' shortest step; less is a turn


@dataclass(frozen=True, kw_only=True)
class ControlEstimate:
    """What the network says of a moment."""

    advance: float  # 0 to 1: to go on rather than turn
    clockwise: float  # 0 to 1: the side to turn to, if it turns
    step_m: float  # of the advance
    carpet_ends: float  # 0 to 1
    free_m: float  # how far the way ahead is free of obstacles, up to a step


def meaning(numbers: NDArray[np.floating[Any]], config: ControlNetConfig) -> ControlEstimate:
    """Return what the network's five outputs mean."""
    first, second, third, ends, free_m = (float(number) for number in numbers)
    if config.learns == "movement":
        return ControlEstimate(
            advance=float(np.clip(0.5 * first / _LEAST_ADVANCE_M, 0.0, 1.0)),
            clockwise=1.0 if second > 0.0 else 0.0,
            step_m=first,
            carpet_ends=float(np.clip(ends, 0.0, 1.0)),
            free_m=free_m,
        )
    return ControlEstimate(
        advance=_share(first),
        clockwise=_share(second),
        step_m=third,
        carpet_ends=_share(ends),
        free_m=free_m,
    )


def _share(logit: float) -> float:
    return float(1.0 / (1.0 + np.exp(-np.clip(logit, -50.0, 50.0))))


class OnnxControlStudent:
    """A control student in an ONNX file, as `export.export_control_onnx` makes it."""

    def __init__(self, path: Path = SHIPPED_STUDENT, *, threads: int = 1) -> None:
        """Load and compile the network.

        Args:
            path: the ONNX file.
            threads: of inference.

        Raises:
            WeightsError: the file is absent, damaged, of another version, or no control student.
        """
        if threads < 1:
            raise ValueRangeError(f"inference needs at least one thread, got {threads}")
        self._path = path
        model = read_model(path, _CURE)
        self.config = _config_of(model, path)
        self._check(model)
        self._request = compile_model(model, threads).create_infer_request()
        _, frames, told = self._shapes()
        self._run(np.zeros(frames, np.float32), np.zeros(told, np.float32))  # the slow first

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height of the pictures it looks at."""
        return self.config.width_px, self.config.height_px

    def looked_at(self, rgb: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Return a picture, (H, W, 3), as the network looks at it: resized, never cropped."""
        return shrunk(rgb, self.size_px)

    def estimate(
        self, pictures: Sequence[NDArray[np.uint8]], numbers: NDArray[np.float32]
    ) -> ControlEstimate:
        """Return what the network says of a moment.

        Args:
            pictures: (h, w, 3) RGB each, as `looked_at` returns them; the present one first.
            numbers: `situation.situation` of that moment.

        Raises:
            ShapeError: there are too few or too many of them, or of another size.
            ValueRangeError: a number of the situation is not finite.
            WeightsError: the network answered with something that is not a number.
        """
        frames, (views, told) = np.stack(pictures), self._shapes()[1:]
        wanted = (views[0], *views[2:], 3)
        if frames.shape != wanted:
            raise ShapeError("views", expected="x".join(map(str, wanted)), actual=frames.shape)
        if numbers.shape != told[1:]:
            raise ShapeError("situation", expected=str(told[1]), actual=numbers.shape)
        # The network's own layers make nought of what is no number, and nobody would see it.
        if not np.isfinite(numbers).all():
            raise ValueRangeError(
                f"the situation must be finite numbers, got {numbers.tolist()}; look at telemetry"
            )
        planes = np.ascontiguousarray(frames.transpose(0, 3, 1, 2), dtype=np.float32) / 255.0
        answer = self._run(planes, numbers[None])
        if not np.isfinite(answer).all():
            raise WeightsError(self._path, "the network's answer holds NaN or infinity")
        return meaning(answer, self.config)

    def _run(
        self, planes: NDArray[np.float32], numbers: NDArray[np.float32]
    ) -> NDArray[np.float32]:
        self._request.infer({"frames": planes, "situation": numbers})
        return np.asarray(self._request.get_output_tensor(0).data).reshape(-1).copy()

    def _shapes(self) -> tuple[tuple[int, ...], tuple[int, ...], tuple[int, ...]]:
        """Return the shapes of output and inputs."""
        config = self.config
        return (
            (1, len(OUTPUTS[config.learns])),
            (config.views, 3, config.height_px, config.width_px),
            (1, situation_size(config.views)),
        )

    def _check(self, model: Any) -> None:
        ports = {port.any_name: port for port in (*model.inputs, *model.outputs)}
        wanted = dict(zip(("movement", "frames", "situation"), self._shapes(), strict=True))
        for name, shape in wanted.items():
            got = ports[name].get_partial_shape() if name in ports else None
            if got is None or got.is_dynamic or tuple(got.to_shape()) != shape:
                raise WeightsError(
                    self._path, f"'{name}' must be {'x'.join(map(str, shape))}, got {got}"
                )


def _config_of(model: Any, path: Path) -> ControlNetConfig:
    if not model.has_rt_info(_ABOUT):
        raise WeightsError(path, f"is no control student; {_CURE} makes one")
    try:
        about = json.loads(model.get_rt_info(_ABOUT).astype(str))
        if about["version"] != VERSION:
            raise WeightsError(
                path,
                f"expected a student of version {VERSION}, got {about['version']}; train it anew: "
                f"{_CURE}",
            )
        return ControlNetConfig.from_json(about["config"])
    except (KeyError, TypeError, ValueError) as error:
        raise WeightsError(path, f"does not say what it is ({error}); {_CURE} makes one") from error
