"""The control student as torch's module, as a file, and in flight: one and the same."""

from __future__ import annotations

import hashlib
from dataclasses import astuple, replace
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import pytest
import torch

from perception.control.ego_state import ControlNetConfig, state_size
from perception.control.runtime import OnnxControlStudent, decode
from perception.control.training.run import STUDENT_FILES, ControlNet
from perception.networks.training.network_files import parameter_count
from perception.networks.weights_file import SHIPPED_WEIGHTS, read_weights, write_weights
from perception.segmentation.training.unet import UNET_FILES, UNet, UNetConfig
from tests.paper_lab import CLASSES
from tests.perception.control.control_world import TINY
from uav_bt.errors import AnswerError, ValueRangeError, WeightsError

RNG = np.random.default_rng(3)
PICTURES = [RNG.integers(0, 256, (16, 32, 3), dtype=np.uint8) for _ in range(3)]
NUMBERS = RNG.normal(size=state_size(3)).astype(np.float32)


def seeded(config: ControlNetConfig = TINY) -> ControlNet:
    torch.manual_seed(1)
    net = ControlNet(config)
    for module in net.modules():  # statistics that a fold would show to be wrong
        if isinstance(module, torch.nn.BatchNorm2d):
            module.running_mean.uniform_(-0.2, 0.2)
            module.running_var.uniform_(0.5, 2.0)
    return net.eval()


@pytest.fixture(scope="module")
def weights(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("student") / "student.safetensors"
    STUDENT_FILES.save(path, seeded(), notes={"steps": 3})
    STUDENT_FILES.export(path, path.with_suffix(".onnx"))
    return path


def predicted_by_torch(net: ControlNet) -> np.ndarray:
    frames = torch.from_numpy(np.stack(PICTURES)).permute(0, 3, 1, 2)[None].float() / 255.0
    with torch.inference_mode():
        return net(frames, torch.from_numpy(NUMBERS)[None]).numpy()[0]


# --- size -----------------------------------------------------------------------------------------


def test_it_is_smaller_than_the_papers() -> None:
    """1.6 million parameters there."""
    assert parameter_count(ControlNet(ControlNetConfig())) < 900_000


@pytest.mark.parametrize("changed", [{"views": 0}, {"spacing_s": 0.0}])
def test_a_shape_that_cannot_be_is_refused(changed: dict[str, Any]) -> None:
    with pytest.raises(ValueRangeError, match="views and their spacing must be positive"):
        replace(TINY, **changed)


def test_views_are_seen_in_their_order() -> None:
    frames = torch.rand(1, 3, 3, 16, 32)
    told = torch.zeros(1, state_size(3))
    net = seeded()
    with torch.inference_mode():
        assert not torch.allclose(net(frames, told), net(frames.flip(1), told))


def test_without_a_past_it_takes_one_view() -> None:
    alone = seeded(replace(TINY, views=1))
    assert alone(torch.rand(2, 1, 3, 16, 32), torch.zeros(2, state_size(1))).shape == (2, 5)


# --- files ----------------------------------------------------------------------------------------


def test_what_flies_says_what_was_trained(weights: Path) -> None:
    """The parity of torch's network and its ONNX file, to the rounding of floats."""
    student = OnnxControlStudent(weights.with_suffix(".onnx"))
    assert student.config == TINY
    assert student.size_px == (32, 16)
    wanted = astuple(decode(predicted_by_torch(seeded())))
    assert astuple(student.estimate(PICTURES, NUMBERS)) == pytest.approx(wanted, abs=1e-5)


def test_in_integers_it_says_almost_the_same(weights: Path, tmp_path: Path) -> None:
    coarse = tmp_path / "int8.onnx"
    STUDENT_FILES.export(weights, coarse, calibration=PICTURES)
    got = OnnxControlStudent(coarse).estimate(PICTURES, NUMBERS)
    wanted = decode(predicted_by_torch(seeded()))
    assert got.advance == pytest.approx(wanted.advance, abs=0.03)
    assert got.step_m == pytest.approx(wanted.step_m, abs=0.03)
    assert coarse.read_bytes() != weights.with_suffix(".onnx").read_bytes()


def test_the_same_weights_give_the_same_file(weights: Path, tmp_path: Path) -> None:
    STUDENT_FILES.export(weights, tmp_path / "again.onnx")
    assert (tmp_path / "again.onnx").read_bytes() == weights.with_suffix(".onnx").read_bytes()


def test_the_file_says_how_it_was_trained(weights: Path) -> None:
    net, notes = STUDENT_FILES.load(weights)
    assert (net.config, notes) == (TINY, {"steps": 3})


# --- refused input --------------------------------------------------------------------------------


def test_weights_of_another_version_are_refused(weights: Path, tmp_path: Path) -> None:
    tensors, details = read_weights(weights, kind="control-student", remedy="")
    old = tmp_path / "old.safetensors"
    write_weights(old, tensors, kind="control-student", details={**details, "version": 0})
    with pytest.raises(WeightsError, match="of version 2, got 0; `uav-bt net train"):
        STUDENT_FILES.export(old, tmp_path / "old.onnx")


def test_weights_that_lack_a_layer_are_refused(weights: Path, tmp_path: Path) -> None:
    tensors, details = read_weights(weights, kind="control-student", remedy="")
    part = tmp_path / "part.safetensors"
    del tensors["head.bias"]
    write_weights(part, tensors, kind="control-student", details=details)
    with pytest.raises(WeightsError, match=r"(?s)is not a complete network .*head\.bias"):
        STUDENT_FILES.export(part, tmp_path / "part.onnx")


def test_another_network_is_no_student(tmp_path: Path) -> None:
    path = tmp_path / "unet.safetensors"
    UNET_FILES.save(
        path,
        UNet(UNetConfig(width_px=32, height_px=16, channels=(4, 8), outputs=17), CLASSES.names),
        notes={},
    )
    UNET_FILES.export(path, path.with_suffix(".onnx"))
    with pytest.raises(WeightsError, match="is not a control student; `uav-bt net train student`"):
        OnnxControlStudent(path.with_suffix(".onnx"))


def test_an_onnx_file_of_another_version_is_refused(weights: Path, tmp_path: Path) -> None:
    model = onnx.load(weights.with_suffix(".onnx"))
    for note in model.metadata_props:
        note.value = note.value.replace('"version": 2', '"version": 7')
    path = tmp_path / "new.onnx"
    path.write_bytes(model.SerializeToString())
    with pytest.raises(WeightsError, match="expected a student of version 2, got 7"):
        OnnxControlStudent(path)


def test_an_answer_that_is_no_number_is_an_error(weights: Path, tmp_path: Path) -> None:
    """Never a silent zero."""
    model = onnx.load(weights.with_suffix(".onnx"))
    (bias,) = [one for one in model.graph.initializer if one.name == "head.bias"]
    bias.CopyFrom(onnx.numpy_helper.from_array(np.full(5, np.nan, np.float32), bias.name))
    path = tmp_path / "nan.onnx"
    path.write_bytes(model.SerializeToString())
    with pytest.raises(AnswerError, match="answer holds NaN or infinity"):
        OnnxControlStudent(path).estimate(PICTURES, NUMBERS)


def test_telemetry_that_is_no_number_is_an_error(weights: Path) -> None:
    student = OnnxControlStudent(weights.with_suffix(".onnx"))
    with pytest.raises(ValueRangeError, match="state must be finite numbers"):
        student.estimate(PICTURES, np.full_like(NUMBERS, np.nan))


def test_a_choice_is_described_by_shares_and_metres() -> None:
    said = decode(np.array([0.0, 2.0, 0.7, -3.0, 0.9]))
    assert astuple(said) == pytest.approx((0.5, 0.881, 0.7, 0.047, 0.9), abs=1e-3)


# --- what ships -----------------------------------------------------------------------------------


def test_the_shipped_onnx_file_was_made_from_the_shipped_weights() -> None:
    weights = SHIPPED_WEIGHTS / "student.safetensors"
    model = onnx.load(SHIPPED_WEIGHTS / "student.onnx")
    properties = {p.key: p.value for p in model.metadata_props}
    assert properties["weights_sha256"] == hashlib.sha256(weights.read_bytes()).hexdigest()


def test_the_shipped_student_returns_the_same_in_flight_and_in_training(tmp_path: Path) -> None:
    weights = SHIPPED_WEIGHTS / "student.safetensors"
    net, notes = STUDENT_FILES.load(weights)
    config = net.config
    assert parameter_count(net) == notes["parameters"] <= 1_600_000
    rng = np.random.default_rng(0)
    views = rng.integers(
        0, 256, (config.views, config.height_px, config.width_px, 3), dtype=np.uint8
    )
    numbers = np.zeros(state_size(config.views), dtype=np.float32)
    frames = torch.from_numpy(views).permute(0, 3, 1, 2)[None].float() / 255.0
    with torch.inference_mode():
        trained = net(frames, torch.from_numpy(numbers)[None]).numpy()[0]
    STUDENT_FILES.export(weights, tmp_path / "student.onnx")
    flies = OnnxControlStudent(tmp_path / "student.onnx")
    said, wanted = flies.estimate(list(views), numbers), decode(trained)
    assert astuple(said) == pytest.approx(astuple(wanted), rel=1e-5, abs=1e-6)
