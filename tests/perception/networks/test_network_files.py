"""Files of networks: training files, exports, mappings of classes, shipped weights."""

import hashlib
import json
from pathlib import Path

import numpy as np
import onnx
import pytest
import torch
from safetensors.numpy import save_file

from perception.depth.runtime import OnnxDepthEstimator
from perception.depth.training.network import DEPTH_FILES, DepthNet, DepthNetConfig
from perception.networks import mapping as module
from perception.networks.mapping import ClassMapping, CountedAsGround, InputFormat
from perception.networks.onnx_runtime import OnnxNetwork
from perception.networks.weights_file import SHIPPED_WEIGHTS, read_weights, write_weights
from perception.segmentation.runtime import OnnxSegmenter
from perception.segmentation.training.unet import UNET_FILES, UNet, UNetConfig
from tests.paper_lab import BACKGROUND, CARPET, CLASSES, HELIPAD_H, paper_map
from tests.perception.networks.small_networks import shaken
from tests.perception.segmentation.patterned import samples
from tests.worlds.tables import cases
from uav_bt.errors import FileError, UnknownNameError, WeightsError
from uav_bt.types import ClassMap, Frame

IMAGES = [rgb for _, rgb, _ in samples(8, seed=3, width=128, height=64)]


@pytest.fixture(scope="module")
def unets(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A U-Net in floats and in 8-bit integers, which answers as torch does and comes back."""
    folder = tmp_path_factory.mktemp("unets")
    torch.manual_seed(5)
    config = UNetConfig(width_px=64, height_px=32, channels=(8, 16), outputs=17)
    net = shaken(UNet(config, CLASSES.names))
    UNET_FILES.save(folder / "unet.safetensors", net, notes={"why": "a test"})
    again, notes = UNET_FILES.load(folder / "unet.safetensors")
    assert (again.config, notes, again.training) == (net.config, {"why": "a test"}, False)
    for name, value in net.state_dict().items():
        assert torch.equal(value, again.state_dict()[name]), name
    paths = folder / "fp32.onnx", folder / "int8.onnx"
    for path, images in zip(paths, (None, IMAGES), strict=True):
        UNET_FILES.export(folder / "unet.safetensors", path, calibration=images)
    UNET_FILES.export(folder / "unet.safetensors", folder / "again.onnx")
    assert (folder / "again.onnx").read_bytes() == paths[0].read_bytes()
    network = OnnxNetwork(paths[0], "nothing")
    network.take_images(InputFormat())
    network.compile([network.outputs()["logits"]], 1)
    rgb = np.random.default_rng(0).integers(256, size=(32, 64, 3), dtype=np.uint8)
    with torch.inference_mode():
        expected = net(torch.from_numpy(rgb[None]).permute(0, 3, 1, 2) / 255.0).numpy()
    np.testing.assert_allclose(network.run(rgb)[0], expected, rtol=1e-5, atol=1e-5)
    ids = OnnxSegmenter(paths[0], CLASSES).ids(rgb)
    np.testing.assert_array_equal(ids, expected[0].argmax(axis=0))
    return paths


def test_a_unet_in_integers_agrees_with_the_one_in_floats(unets: tuple[Path, Path]) -> None:
    exact, integers = (OnnxSegmenter(path, CLASSES) for path in unets)
    agreeing = [(exact.ids(rgb) == integers.ids(rgb)).mean() for rgb in IMAGES]
    assert len(np.unique(exact.ids(IMAGES[0]))) > 2
    # Untrained, it has many ties to break.
    assert np.mean(agreeing) > 0.95
    for path, precision in zip(unets, ("fp32", "int8"), strict=True):
        properties = {each.key: each.value for each in onnx.load(path).metadata_props}
        assert len(properties["weights_sha256"]) == 64
        assert properties["precision"] == precision
        assert json.loads(properties["classes"])[2] == "helipad_h"
    assert sum(path.stat().st_size for path in SHIPPED_WEIGHTS.iterdir()) < 25e6


@pytest.mark.parametrize("name", ["any", "depth", "student", "unet"])
def test_a_shipped_onnx_file_was_made_from_the_shipped_weights(name: str) -> None:
    weights, model = (SHIPPED_WEIGHTS / f"{name}.{end}" for end in ("safetensors", "onnx"))
    properties = {each.key: each.value for each in onnx.load(model).metadata_props}
    assert properties["precision"] == "int8"
    assert properties["weights_sha256"] == hashlib.sha256(weights.read_bytes()).hexdigest()


def test_a_depth_network_in_integers_agrees_with_the_one_in_floats(tmp_path: Path) -> None:
    torch.manual_seed(5)
    net = shaken(DepthNet(DepthNetConfig(width_px=64, height_px=32, channels=(8, 12, 16))))
    DEPTH_FILES.save(tmp_path / "w.safetensors", net, notes={})
    depths = []
    for images in (None, IMAGES):
        DEPTH_FILES.export(tmp_path / "w.safetensors", tmp_path / "net.onnx", calibration=images)
        estimator = OnnxDepthEstimator(tmp_path / "net.onnx")
        depths.append(np.stack([estimator.depth(rgb) for rgb in IMAGES]))
    assert np.ptp(depths[0]) > 0.02
    assert np.median(np.abs(depths[1] / depths[0] - 1.0)) < 0.02


def test_convolutions_overflow_on_no_processor(unets: tuple[Path, Path]) -> None:
    """Weights of seven bits; levels of activations unsigned, as OpenVINO needs them."""
    graph = onnx.load(unets[1]).graph
    arrays = {each.name: onnx.numpy_helper.to_array(each) for each in graph.initializer}
    makers = {node.output[0]: node for node in graph.node}
    convolutions = [node for node in graph.node if node.op_type in ("Conv", "ConvTranspose")]
    assert convolutions
    for node in convolutions:
        levels = arrays[makers[node.input[1]].input[0]]
        assert levels.dtype == np.int8
        assert np.abs(levels.astype(int)).max() <= 64
    for node in graph.node:
        if node.op_type == "QuantizeLinear":
            assert arrays[node.input[2]].dtype == np.uint8


# --- weights files --------------------------------------------------------------------------------


@pytest.mark.parametrize("details", ["{", "[" * 100_000, "1e999", "9" * 5000])
def test_damaged_details_are_refused(tmp_path: Path, details: str) -> None:
    path = tmp_path / "net.safetensors"
    save_file({"a": np.zeros(1)}, path, metadata={"kind": "unet", "details": details})
    with pytest.raises(WeightsError, match=r"damaged \(no JSON.*; train it"):
        read_weights(path, kind="unet", remedy="train it")


def test_the_same_weights_are_the_same_bytes(tmp_path: Path) -> None:
    files = [tmp_path / f"{number}.safetensors" for number in range(8)]
    for file in files:
        write_weights(file, {"w": np.arange(3.0)}, kind="u-net", details={"steps": 2})
    assert len({file.read_bytes() for file in files}) == 1
    tensors, details = read_weights(files[0], kind="u-net", remedy="")
    assert list(tensors["w"]) == [0.0, 1.0, 2.0]
    assert details == {"steps": 2}


# --- mappings from a foreign network's classes to ours --------------------------------------------


def _read(tmp_path: Path, text: str) -> ClassMapping:
    path = tmp_path / "foreign.yaml"
    path.write_text(text, encoding="utf-8")
    return module.read_mapping(path, CLASSES)


def test_names_of_classes_and_roles_become_ids(tmp_path: Path) -> None:
    """JSON is as good as YAML."""
    mapping = _read(tmp_path, "classes: {0: background, 3: obstacle, 4: roof_2, 7: mark}")
    assert mapping.table(9, CLASSES).tolist() == [0, 0, 0, 4, 13, 0, 0, 3, 0]
    mapping = _read(tmp_path, "default: obstacle\nclasses: {1: carpet}")
    assert mapping.table(3, CLASSES).tolist() == [4, 1, 4]
    wanted = {"mean": (1, 2, 3), "scale": (4, 5, 6.5), "colours": "bgr", "layout": "nhwc"}
    mapping = _read(tmp_path, json.dumps({"classes": {"2": "carpet"}, "input": wanted}))
    assert mapping.table(3, CLASSES)[2] == 1
    assert mapping.input == InputFormat(**wanted)


@pytest.mark.parametrize(("text", "message"), cases("perception")["mappings"])
def test_a_bad_mapping_is_refused_with_the_reason(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(FileError, match=message):
        _read(tmp_path, text)


def test_a_bad_mapping_of_depth_is_refused(tmp_path: Path) -> None:
    for text, message in (
        ("output: disparit", "1: output: expected 'depth' or 'disparity', got 'disparit'"),
        ("input: {}", "n.yaml:1: lacks the key 'output'"),
    ):
        (tmp_path / "n.yaml").write_text(text, encoding="utf-8")
        with pytest.raises(FileError, match=message):
            module.read_depth_mapping(tmp_path / "n.onnx")


def test_classes_of_ground_become_the_ground_and_others_stay() -> None:
    class Told:
        def segment(self, frame: Frame) -> ClassMap:
            ids = np.array([[BACKGROUND, CARPET, HELIPAD_H, 7]], np.uint8)
            return paper_map(ids=ids, captured_s=frame.captured_s)

    frame = Frame(image=np.zeros((2, 2, 3), np.uint8), index=0, captured_s=3.0, gimbal_pitch_rad=0)
    told = CountedAsGround(Told(), CLASSES, ["background"]).segment(frame)
    assert told.ids.tolist() == [[CARPET, CARPET, HELIPAD_H, 7]]
    assert told.captured_s == 3.0
    with pytest.raises(UnknownNameError, match="did you mean 'carpet'"):
        CountedAsGround(Told(), CLASSES, ["carpets"])
