"""Export of networks, and the shipped networks on images of the twin."""

from __future__ import annotations

import hashlib
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import pytest
from click.testing import CliRunner

from perception.control.ego_state import state_size
from perception.control.runtime import OnnxControlStudent
from perception.control.training.network import STUDENT_FILES
from perception.depth.runtime import load_depth_estimator
from perception.depth.training.network import DEPTH_FILES
from perception.networks.training.network_files import NetworkFiles
from perception.networks.weights_file import SHIPPED_WEIGHTS
from perception.segmentation.runtime import OnnxSegmenter, shipped_unet
from perception.segmentation.training.unet import UNET_FILES
from tests.paper_lab import CLASSES
from uav_bt.cli.root import uav_bt
from uav_bt.learning.lab_training import UNET_WEIGHTS
from uav_bt.learning.training import CALIBRATION_VIEWS, export_network
from uav_bt.learning.views import TRAINING_SCENES, VALIDATION_SCENES, ViewPlan, twin_views

SHIPPED: dict[str, NetworkFiles[Any]] = {
    "unet": UNET_FILES,
    "depth": DEPTH_FILES,
    "student": STUDENT_FILES,
}


@pytest.fixture(scope="module")
def floats(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Export the shipped weights in floats; return the folder."""
    folder = tmp_path_factory.mktemp("floats")
    for name, files in SHIPPED.items():
        files.export(SHIPPED_WEIGHTS / f"{name}.safetensors", folder / f"{name}.onnx")
    return folder


@pytest.fixture(scope="module")
def pictures() -> list[np.ndarray]:
    """Return images that were not used for training or calibration."""
    plan = ViewPlan(scenes=VALIDATION_SCENES, views=8, size_px=(640, 360), truth_size_px=(32, 18))
    return [rgb for _, rgb, _ in twin_views(plan)]


# --- shipped networks -----------------------------------------------------------------------------


def test_the_unet_that_flies_sees_what_the_one_in_floats_sees(
    floats: Path, pictures: list[np.ndarray]
) -> None:
    flies, exact = shipped_unet(), OnnxSegmenter(floats / "unet.onnx", CLASSES)
    agreeing = np.array([(flies.ids(rgb) == exact.ids(rgb)).mean() for rgb in pictures])
    assert agreeing.mean() > 0.999
    assert agreeing.min() > 0.99


def test_the_depth_network_that_flies_says_what_the_one_in_floats_says(
    floats: Path, pictures: list[np.ndarray]
) -> None:
    flies, exact = load_depth_estimator("depth"), load_depth_estimator(floats / "depth.onnx")
    off = np.stack([np.abs(flies.depth(rgb) / exact.depth(rgb) - 1.0) for rgb in pictures])
    assert off.mean() < 0.01
    assert np.quantile(off, 0.99) < 0.04


def test_the_student_that_flies_decides_as_the_one_in_floats(
    floats: Path, pictures: list[np.ndarray]
) -> None:
    both = [OnnxControlStudent(path / "student.onnx") for path in (SHIPPED_WEIGHTS, floats)]
    numbers = np.zeros(state_size(both[0].config.views), dtype=np.float32)
    said = []
    for student in both:
        views = [[student.preprocess(rgb)] * student.config.views for rgb in pictures]
        said.append([student.estimate(one, numbers) for one in views])
    off = np.array(
        [[a.advance - b.advance, a.step_m - b.step_m] for a, b in zip(*said, strict=True)]
    )
    assert np.abs(off).mean() < 0.03
    assert np.abs(off).max() < 0.25


def _convolutions(model: onnx.ModelProto) -> dict[str, tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Return weights, steps of their integers (0 for floats) and biases of all convolutions."""
    arrays = {each.name: onnx.numpy_helper.to_array(each) for each in model.graph.initializer}
    makers = {node.output[0]: node for node in model.graph.node}
    found = {}
    for node in model.graph.node:
        if node.op_type not in ("Conv", "ConvTranspose"):
            continue
        weights, bias = node.input[1:]
        if weights in arrays:
            found[node.name] = arrays[weights], np.zeros(()), arrays[bias]
            continue
        levels, scale, zero = (arrays[name] for name in makers[weights].input)
        axes = [
            axis
            for axis, length in enumerate(levels.shape)
            if axis != next(each.i for each in makers[weights].attribute if each.name == "axis")
            or length != scale.size
        ]
        step, zero = (np.expand_dims(each, axes) if each.ndim else each for each in (scale, zero))
        found[node.name] = (levels.astype(np.float32) - zero) * step, step, arrays[bias]
    return found


@pytest.mark.parametrize("name", SHIPPED)
def test_a_shipped_network_holds_the_shipped_weights_in_integers(name: str, floats: Path) -> None:
    """By the hash in its metadata, and number by number, to half a step of its integers."""
    models = [onnx.load(folder / f"{name}.onnx") for folder in (SHIPPED_WEIGHTS, floats)]
    notes = [{each.key: each.value for each in model.metadata_props} for model in models]
    assert [note.pop("precision") for note in notes] == ["int8", "fp32"]
    # The shipped student's file has an earlier name of an output in its description.
    students = [json.loads(note.pop("control", "{}")) for note in notes]
    assert students[0].get("config") == students[1].get("config")
    assert students[0].get("version") == students[1].get("version")
    assert notes[0] == notes[1]
    source = (SHIPPED_WEIGHTS / f"{name}.safetensors").read_bytes()
    assert notes[0]["weights_sha256"] == hashlib.sha256(source).hexdigest()
    flies, exact = map(_convolutions, models)
    assert flies.keys() == exact.keys()
    assert all((step > 0).all() for _, step, _ in flies.values())
    for layer, (weights, step, bias) in flies.items():
        wanted, _, wanted_bias = exact[layer]
        assert (np.abs(weights - wanted) <= 0.501 * step).all(), layer
        # Builds of PyTorch and CPUs round the folded normalisation differently, in the last bits.
        np.testing.assert_allclose(bias, wanted_bias, rtol=1e-5, atol=1e-6)


# --- export ---------------------------------------------------------------------------------------


def test_a_network_is_calibrated_on_the_pictures_of_the_plan(
    tmp_path: Path, floats: Path, pictures: list[np.ndarray]
) -> None:
    """A few images of one scene suffice, and the same images always give the same file."""
    assert set(CALIBRATION_VIEWS.scenes) == set(TRAINING_SCENES)
    plan = replace(CALIBRATION_VIEWS, scenes=("train-a",), views=4)
    told: list[tuple[str, int, int]] = []
    for name in ("one.onnx", "two.onnx"):
        export_network(
            "depth",
            SHIPPED_WEIGHTS / "depth.safetensors",
            tmp_path / name,
            views=plan,
            advance=lambda *now: told.append(now),
        )
    assert told[:4] == [("calibration", done, 4) for done in range(1, 5)]
    assert (tmp_path / "one.onnx").read_bytes() == (tmp_path / "two.onnx").read_bytes()
    mine = load_depth_estimator(tmp_path / "one.onnx")
    exact = load_depth_estimator(floats / "depth.onnx")
    off = [np.abs(mine.depth(rgb) / exact.depth(rgb) - 1.0) for rgb in pictures[:4]]
    assert np.median(off) < 0.03


def test_floats_need_no_pictures(tmp_path: Path, floats: Path) -> None:
    export_network(
        "depth",
        SHIPPED_WEIGHTS / "depth.safetensors",
        tmp_path / "depth.onnx",
        precision="fp32",
        views=replace(CALIBRATION_VIEWS, scenes=("no such scene",)),
    )
    assert (tmp_path / "depth.onnx").read_bytes() == (floats / "depth.onnx").read_bytes()


# --- the command ----------------------------------------------------------------------------------


def test_the_command_writes_a_network(tmp_path: Path) -> None:
    out = tmp_path / "net.onnx"
    arguments = ["net", "export", "depth", "--out", str(out), "--scene", "train-a", "--views", "1"]
    result = CliRunner().invoke(uav_bt, arguments)
    assert result.exit_code == 0, result.output
    assert f"network in int8: {out}, 1.1 MB" in result.output
    assert load_depth_estimator(out).size_px == (320, 256)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["depth", "--out", "net.xml"], "must end in .onnx"),
        (["depth", "--precision", "int4"], "'int4' is not one of"),
        (["depth", "--weights", "absent.safetensors"], "absent.safetensors"),
        (["depth", "--weights", str(UNET_WEIGHTS)], "expected weights of kind 'depth-network'"),
    ],
)
def test_what_cannot_be_exported_is_refused(
    arguments: list[str], message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    result = CliRunner().invoke(uav_bt, ["net", "export", *arguments])
    assert result.exit_code == 2
    assert message in result.output
    assert not list(tmp_path.rglob("*.onnx"))
