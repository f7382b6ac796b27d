"""A network's files: safetensors holds the weights, and ONNX is generated from it.

torch traces the graph. NNCF (the Neural Network Compression Framework) quantises it to 8-bit
integers, which take half the time on a CPU and a quarter of the space.
"""

from __future__ import annotations

import hashlib
import io
import logging
import math
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import redirect_stdout
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Final, Generic, TypeVar

import numpy as np
import onnx
import torch
from torch import nn

from perception.networks.inference_packages import import_nncf
from perception.networks.onnx_runtime import shrunk
from perception.networks.weights_file import read_weights, write_weights
from uav_bt.errors import WeightsError
from uav_bt.files import write_whole
from uav_bt.types.arrays import Floats32, Image

_OPSET: Final = 18
# Only convolutions are quantised: other operators lose accuracy in integers and save little time.
_FLOAT_OPS: Final = ("Add", "Gemm", "Mul", "Reciprocal", "Resize", "Sub")
_BATCH_COUNTS: Final = "num_batches_tracked"  # of batch norms; unused, so files leave it out


Net = TypeVar("Net", bound=nn.Module)


@dataclass(frozen=True, kw_only=True)
class OnnxPorts:
    """Inputs and outputs of an ONNX file. All shapes are fixed."""

    # Shapes by name, as `forward` has them. The first takes images, (..., 3, H, W) RGB in [0, 1].
    inputs: Mapping[str, tuple[int, ...]]
    outputs: tuple[str, ...]
    metadata: Mapping[str, str] = field(default_factory=dict)  # checked by the runtime


@dataclass(frozen=True, kw_only=True)
class NetworkFiles(Generic[Net]):
    """How the files of one network are written and read."""

    kind: str  # of the safetensors file; reading checks it
    remedy: str  # how to make such a file, for messages
    build: Callable[[dict[str, Any]], Net]  # makes the network from the file's JSON values
    ports: Callable[[Net], OnnxPorts]
    version: int = 1  # of layer names, inputs and outputs; files of another version are refused
    # Further JSON values in the file, beside the network's config.
    details: Callable[[Net], Mapping[str, Any]] = lambda _: {}

    def save(self, path: Path, net: Net, *, notes: Mapping[str, Any]) -> None:
        """Write a network's weights and its `config`, a dataclass; notes say how it was trained."""
        tensors = {
            name: tensor.detach().numpy()
            for name, tensor in net.state_dict().items()
            if not name.endswith(_BATCH_COUNTS)
        }
        config: Any = net.config
        details = {"config": asdict(config), "version": self.version, "notes": dict(notes)}
        write_weights(path, tensors, kind=self.kind, details={**self.details(net), **details})

    def load(self, path: Path) -> tuple[Net, dict[str, Any]]:
        """Return the network of a file, in evaluation mode, and its notes."""
        tensors, details = read_weights(path, kind=self.kind, remedy=self.remedy)
        version = details.get("version", 1)
        if version != self.version:
            wanted = f"a {self.kind} of version {self.version}"
            raise WeightsError(path, f"expected {wanted}, got {version}; {self.remedy}")
        for name, tensor in tensors.items():
            if not np.isfinite(tensor).all():
                raise WeightsError(path, f"holds NaN or infinity ({name}); {self.remedy}")
        try:
            net = self.build(details)
            counts = {k: v for k, v in net.state_dict().items() if k.endswith(_BATCH_COUNTS)}
            known = {name: torch.from_numpy(tensor) for name, tensor in tensors.items()}
            net.load_state_dict({**counts, **known})
        except (KeyError, TypeError, RuntimeError) as error:
            why = " ".join(str(error).split())  # torch writes several lines
            raise WeightsError(path, f"is not a complete network ({why}); {self.remedy}") from error
        return net.eval(), details.get("notes", {})

    def export(
        self, weights: Path, onnx_path: Path, *, calibration: Iterable[Image] | None = None
    ) -> None:
        """Generate the ONNX file of the weights; the same weights and images give the same bytes.

        Its metadata states the precision: `int8`, or `fp32` without images, (h, w, 3) uint8 RGB of
        any size, that give the ranges of the 8-bit integers.
        """
        net, _ = self.load(weights)
        ports = self.ports(net)
        model = _traced(net, ports)
        if calibration is not None:
            model = _in_integers(model, ports, calibration)
        metadata = {
            **ports.metadata,
            "weights_sha256": hashlib.sha256(weights.read_bytes()).hexdigest(),
            "precision": "fp32" if calibration is None else "int8",
        }
        del model.metadata_props[:]
        onnx.helper.set_model_props(model, metadata)
        onnx.checker.check_model(model, full_check=True)
        onnx_path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(onnx_path, model.SerializeToString(deterministic=True))


def parameter_count(net: nn.Module) -> int:
    """Return the number of trained parameters of a network."""
    return sum(parameter.numel() for parameter in net.parameters())


def _traced(net: nn.Module, ports: OnnxPorts) -> onnx.ModelProto:
    """Return the graph of a network in floats; batch norms are folded into convolutions."""
    content = io.BytesIO()
    with warnings.catch_warnings():
        # torch recommends its newer exporter, which needs onnxscript and gives the same graph.
        warnings.simplefilter("ignore", DeprecationWarning)
        # The exporter leaves the sizes of mirrored borders to the runtime.
        warnings.filterwarnings("ignore", "Constant folding", UserWarning)
        torch.onnx.export(
            net,
            tuple(torch.zeros(shape) for shape in ports.inputs.values()),
            content,  # type: ignore[arg-type]  # torch's stubs know paths only
            input_names=list(ports.inputs),
            output_names=list(ports.outputs),
            opset_version=_OPSET,
            dynamo=False,
        )
    return onnx.load_from_string(content.getvalue())


def _in_integers(
    model: onnx.ModelProto, ports: OnnxPorts, images: Iterable[Image]
) -> onnx.ModelProto:
    """Return a network whose convolutions compute in 8-bit integers.

    Ranges are the extremes over all images. NNCF's default cuts off the rarest values, which are
    the obstacles nearest to the drone. Weights have seven bits: processors without VNNI add two
    8-bit products in 16 bits, which would overflow.
    """
    samples = list(_samples(ports, images))
    nncf = import_nncf()
    logging.getLogger("nncf").setLevel(logging.ERROR)
    extremes = nncf.quantization.range_estimator.RangeEstimatorParametersSet.MINMAX
    advanced = nncf.quantization.advanced_parameters
    with redirect_stdout(io.StringIO()):  # hides NNCF's progress bars
        quantized: onnx.ModelProto = nncf.quantize(
            model,
            nncf.Dataset(samples),
            preset=nncf.QuantizationPreset.MIXED,
            subset_size=len(samples),
            ignored_scope=nncf.IgnoredScope(types=list(_FLOAT_OPS), validate=False),
            advanced_parameters=advanced.AdvancedQuantizationParameters(
                overflow_fix=advanced.OverflowFix.ENABLE,
                disable_bias_correction=True,  # nearly doubles the depth network's error
                activations_range_estimator_params=extremes,
                weights_range_estimator_params=extremes,
            ),
        )
    _make_unsigned(quantized)
    return quantized


def _make_unsigned(model: onnx.ModelProto) -> None:
    """Rewrite signed activation levels as unsigned ones with the same values.

    OpenVINO 2026.4 computes wrong borders for signed levels with a zero point other than 0.
    """
    del model.graph.value_info[:]  # the old types
    constants = {constant.name: constant for constant in model.graph.initializer}
    kinds = ("QuantizeLinear", "DequantizeLinear")
    nodes = (node for node in model.graph.node if node.op_type in kinds)
    for name in {node.input[2] for node in nodes if node.input[0] not in constants}:
        zero = onnx.numpy_helper.to_array(constants[name])
        if zero.dtype == np.int8:
            unsigned = (zero.astype(np.int16) + 128).astype(np.uint8)
            constants[name].CopyFrom(onnx.numpy_helper.from_array(unsigned, name))


def _samples(ports: OnnxPorts, images: Iterable[Image]) -> Iterator[dict[str, Floats32]]:
    """Yield inputs of consecutive images; all other inputs are zero."""
    (name, shape), *others = ports.inputs.items()
    height, width = shape[-2:]
    small = [shrunk(rgb, (width, height)) for rgb in images]
    zeros = {other: np.zeros(size, dtype=np.float32) for other, size in others}
    for first in range(len(small)):
        chosen = [small[(first + at) % len(small)] for at in range(math.prod(shape[:-3]))]
        planes = np.stack(chosen).transpose(0, 3, 1, 2).astype(np.float32) / 255.0
        yield {name: planes.reshape(shape), **zeros}
