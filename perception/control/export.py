"""The control student as files: safetensors is the source of truth, ONNX is generated from it.

It imports without torch.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from perception.control.config import OUTPUTS, VERSION, ControlNetConfig
from perception.control.situation import situation_size
from perception.networks.onnx_graph import GraphWriter, Tensors, import_onnx, write_onnx
from perception.networks.onnx_runtime import shrunk
from perception.networks.quantization import quantized
from perception.networks.weights import load_tensors, save_network
from uav_bt.errors import ShapeError, WeightsError

__all__ = ["CURE", "export_control_onnx", "load_control_tensors", "save_control_net"]

CURE: Final = "`uav-bt train student` makes them"
_KIND: Final = "control-student"


def save_control_net(path: Path, net: Any, *, notes: Mapping[str, Any]) -> None:
    """Write the weights of a `network.ControlNet`, with notes on how it was trained."""
    save_network(path, net, kind=_KIND, details={"version": VERSION, "notes": dict(notes)})


def load_control_tensors(
    path: Path,
) -> tuple[dict[str, NDArray[np.float32]], ControlNetConfig, dict[str, Any]]:
    """Return the weights by name, the network's shape, and notes.

    Raises:
        WeightsError: the file is absent, damaged, of another version or something else.
    """
    tensors, details = load_tensors(path, kind=_KIND, cure=CURE)
    if details.get("version") != VERSION:
        raise WeightsError(
            path, f"expected version {VERSION}, got {details.get('version')}; train it anew: {CURE}"
        )
    try:
        return tensors, ControlNetConfig.from_json(details["config"]), details.get("notes", {})
    except KeyError as error:
        raise WeightsError(path, f"lacks {error}; {CURE}") from error


def export_control_onnx(
    weights: Path, onnx_path: Path, *, calibration: Iterable[NDArray[np.uint8]] | None = None
) -> None:
    """Generate the ONNX file of the weights; replaced in one step. All its shapes are fixed.

    Inputs `frames`: (V, 3, H, W) float32 RGB in [0, 1], the present view first, and `situation`:
    (1, S) float32. Output `movement`: (1, 5) float32. The file's metadata says what they are
    (`control`, JSON), and holds the SHA-256 of the weights and the precision: `fp32` or `int8`. In
    8-bit integers are the convolutions; the dense layers take less than a twentieth of the time.

    Args:
        weights: the safetensors file.
        onnx_path: the file to write.
        calibration: pictures, (h, w, 3) RGB of any size, that say what numbers the network meets:
            it then computes in 8-bit integers. None for floats.

    Raises:
        WeightsError: the weights are absent, damaged or lack a tensor.
        ShapeError: there is no picture to calibrate on.
        MissingDependencyError: the package onnx is absent.
    """
    tensors, config, _ = load_control_tensors(weights)
    size_px = (config.width_px, config.height_px)
    try:
        model = _Encoder(tensors).model(config)
        if calibration is not None:
            pictures = [shrunk(rgb, size_px) for rgb in calibration]
            if not pictures:
                raise ShapeError("pictures", expected="Nxhxwx3, N > 0", actual=(0,))
            model = quantized(model, np.stack(pictures))
        whole = _joined(model, tensors, config)
    except KeyError as error:
        raise WeightsError(weights, f"lacks {error}; {CURE}") from error
    about = {
        "version": VERSION,
        "outputs": list(OUTPUTS[config.learns]),
        "config": config.to_json(),
    }
    notes = {
        "control": json.dumps(about, sort_keys=True),
        "precision": "fp32" if calibration is None else "int8",
    }
    write_onnx(whole, onnx_path, weights, notes)


class _Encoder(GraphWriter):
    """The part of `network.ControlNet` that one view goes through, but for its dense layer."""

    def model(self, config: ControlNetConfig) -> Any:
        """Return the part as a model of its own: `image`, (1, 3, H, W), to `seen`."""
        features = self.node("Sub", "centred", ["image", self.constant("half", np.float32(0.5))])
        for level in range(len(config.channels)):
            if level:
                features = self.node(
                    "MaxPool", f"pool{level}", [features], kernel_shape=[2, 2], strides=[2, 2]
                )
            for convolution, norm in ((0, 1), (3, 4)):
                here = f"down.{level}.{convolution}"
                halves = self.kernel(here) == 6  # the first convolution of `unet.UNet`
                shape = {"pads": [2] * 4, "strides": [2, 2]} if halves else {"pads": [1] * 4}
                summed = self.normed(here, f"down.{level}.{norm}", features, **shape)
                features = self.node("Relu", f"{here}.relu", [summed])
        narrow = self.node("Conv", "narrow", [features, *self.weights("narrow")])
        self.node("Relu", "seen", [narrow])
        size = (config.height_px, config.width_px)
        return self.finish("encoder", "seen", size=size, shape=(config.narrow, *config.places))


class _Dense(GraphWriter):
    """The dense layers."""

    def parts(self, config: ControlNetConfig) -> tuple[list[Any], list[Any]]:
        """Return nodes and constants that go on from `seen`, (V, narrow, h, w)."""
        views, height, width = config.views, *config.places
        flat = self._shaped("flat", "seen", (views, config.narrow * height * width))
        rows = self._layer("embed", flat)
        row = self._shaped("row", rows, (1, views * config.embedding))
        joined = self.node("Concat", "joined", [row, "situation"], axis=1)
        thought = self._layer("think", self._layer("join", joined))
        self.node("Gemm", "movement", [thought, *self.weights("say")], transB=1)
        return self._nodes, self._constants

    def _layer(self, name: str, numbers: str) -> str:
        summed = self.node("Gemm", name, [numbers, *self.weights(name)], transB=1)
        return self.node("Relu", f"{name}.relu", [summed])

    def _shaped(self, name: str, numbers: str, shape: tuple[int, ...]) -> str:
        return self.node(
            "Reshape", name, [numbers, self.constant(f"{name}.shape", np.array(shape))]
        )


def _joined(encoder: Any, tensors: Tensors, config: ControlNetConfig) -> Any:
    """Return the whole network: the encoder for all views at once, and the dense layers."""
    helper, kind = import_onnx().helper, import_onnx().TensorProto.FLOAT
    nodes, constants = _Dense(tensors).parts(config)
    graph = encoder.graph
    for node in graph.node:
        node.input[:] = ["frames" if name == "image" else name for name in node.input]
    graph.node.extend(nodes)
    graph.initializer.extend(constants)
    del graph.input[:], graph.output[:], graph.value_info[:]
    sizes = [config.views, 3, config.height_px, config.width_px]
    told = [1, situation_size(config.views)]
    graph.input.append(helper.make_tensor_value_info("frames", kind, sizes))
    graph.input.append(helper.make_tensor_value_info("situation", kind, told))
    said = [1, len(OUTPUTS[config.learns])]
    graph.output.append(helper.make_tensor_value_info("movement", kind, said))
    graph.name = "control-student"
    return encoder
