"""Networks in 8-bit integers say what the networks in floats say."""

from pathlib import Path

import numpy as np
import onnx
import pytest
import torch

from perception.depth.runtime import OnnxDepthEstimator
from perception.depth.training import export as depth_export
from perception.depth.training import network
from perception.networks import quantization
from perception.segmentation.runtime import OnnxSegmenter
from perception.segmentation.training import export, unet
from tests.perception.segmentation.patterned import samples
from uav_bt.errors import ShapeError

PICTURES = [rgb for _, rgb, _ in samples(8, seed=3, width=128, height=64)]


def _shaken(net: torch.nn.Module) -> torch.nn.Module:
    """Return a network with statistics unlike those of a fresh one, and weights that matter."""
    torch.manual_seed(3)
    for module in net.modules():
        if isinstance(module, torch.nn.BatchNorm2d):
            module.running_mean.uniform_(-0.2, 0.2)
            module.running_var.uniform_(0.3, 1.0)
            torch.nn.init.uniform_(module.weight, 0.5, 1.5)
    return net.eval()


@pytest.fixture(scope="module")
def unets(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A U-Net in floats and in 8-bit integers."""
    folder = tmp_path_factory.mktemp("unets")
    torch.manual_seed(5)
    net = _shaken(unet.UNet(unet.UNetConfig(width_px=64, height_px=32, channels=(8, 16))))
    export.save_unet(folder / "unet.safetensors", net, notes={})
    paths = folder / "fp32.onnx", folder / "int8.onnx"
    for path, pictures in zip(paths, (None, PICTURES), strict=True):
        export.export_onnx(folder / "unet.safetensors", path, calibration=pictures)
    return paths


def test_a_unet_in_integers_agrees_with_the_one_in_floats(unets: tuple[Path, Path]) -> None:
    floats, integers = (OnnxSegmenter(path) for path in unets)
    agreeing = [(floats.ids(rgb) == integers.ids(rgb)).mean() for rgb in PICTURES]
    assert len(np.unique(floats.ids(PICTURES[0]))) > 2
    # Untrained, it has many ties to break.
    assert np.mean(agreeing) > 0.95


def test_a_depth_network_in_integers_agrees_with_the_one_in_floats(tmp_path: Path) -> None:
    torch.manual_seed(5)
    net = network.DepthNet(network.DepthNetConfig(width_px=64, height_px=32, channels=(8, 12, 16)))
    depth_export.save_depth_net(tmp_path / "w.safetensors", _shaken(net), notes={})
    depths = []
    for pictures in (None, PICTURES):
        path = tmp_path / "net.onnx"
        depth_export.export_depth_onnx(tmp_path / "w.safetensors", path, calibration=pictures)
        estimator = OnnxDepthEstimator(path)
        depths.append(np.stack([estimator.depth(rgb) for rgb in PICTURES]))
    assert np.ptp(depths[0]) > 0.02
    assert np.median(np.abs(depths[1] / depths[0] - 1.0)) < 0.02


def test_weights_are_integers_that_no_processor_overflows_with(unets: tuple[Path, Path]) -> None:
    graph = onnx.load(unets[1]).graph
    arrays = {each.name: onnx.numpy_helper.to_array(each) for each in graph.initializer}
    convolutions = [node for node in graph.node if node.op_type in ("Conv", "ConvTranspose")]
    assert convolutions
    for node in convolutions:
        weight = arrays[f"{node.input[1]}.levels"]
        assert weight.dtype == np.int8
        assert np.abs(weight).max() == 63
        assert node.input[1] not in arrays


def test_every_convolution_reads_rounded_numbers(unets: tuple[Path, Path]) -> None:
    model = onnx.load(unets[1])
    makers = {node.output[0]: node for node in model.graph.node}
    for node in model.graph.node:
        if node.op_type in ("Conv", "ConvTranspose"):
            todo = [node.input[0]]
            while todo:
                maker = makers[todo.pop()]
                if maker.op_type in ("Concat", "MaxPool"):
                    todo += maker.input
                else:
                    assert maker.op_type == "DequantizeLinear"


def test_what_is_joined_has_the_same_levels(unets: tuple[Path, Path]) -> None:
    graph = onnx.load(unets[1]).graph
    arrays = {each.name: onnx.numpy_helper.to_array(each) for each in graph.initializer}
    (join,) = [node for node in graph.node if node.op_type == "Concat"]
    steps = {float(arrays[name.replace(".rounded", ".step")]) for name in join.input}
    assert len(steps) == 1


def test_biases_make_good_what_rounding_shifts(
    unets: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without the correction the scores' means are further off."""
    model = onnx.load(unets[0])
    pictures = np.stack([rgb[::2, ::2] for rgb in PICTURES])
    (wanted,) = quantization._channel_means(model, ["logits"], pictures)

    def error() -> float:
        coarse = quantization.quantized(model, pictures)
        (got,) = quantization._channel_means(coarse, ["logits"], pictures)
        return float(np.abs(got - wanted).max())

    corrected = error()
    monkeypatch.setattr(quantization, "_correct_biases", lambda *_: None)
    assert corrected < 0.2 * error()


def test_the_file_says_what_it_computes_in(unets: tuple[Path, Path]) -> None:
    said = []
    for path in unets:
        properties = {each.key: each.value for each in onnx.load(path).metadata_props}
        assert len(properties["weights_sha256"]) == 64
        said.append(properties["precision"])
    assert said == ["fp32", "int8"]


def test_a_network_in_integers_takes_a_quarter_of_the_space() -> None:
    from perception.networks.weights_file import SHIPPED_WEIGHTS  # noqa: PLC0415 - only this test needs it

    for name in ("unet", "depth"):
        sizes = [(SHIPPED_WEIGHTS / f"{name}{end}.onnx").stat().st_size for end in ("", "-fp32")]
        assert sizes[0] < 0.3 * sizes[1]


def test_pictures_of_another_size_and_none_at_all_are_refused(
    unets: tuple[Path, Path], tmp_path: Path
) -> None:
    model = onnx.load(unets[0])
    with pytest.raises(ShapeError, match="pictures must be Nx32x64x3, got 2x16x64x3"):
        quantization.quantized(model, np.zeros((2, 16, 64, 3), dtype=np.uint8))
    with pytest.raises(ShapeError, match="got 0x32x64x3"):
        export.export_onnx(
            unets[0].parent / "unet.safetensors", tmp_path / "none.onnx", calibration=[]
        )
    assert not (tmp_path / "none.onnx").exists()
