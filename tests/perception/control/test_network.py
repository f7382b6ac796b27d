"""The control student's network and its training."""

import math
from dataclasses import astuple, replace
from pathlib import Path

import numpy as np
import onnx
import pytest
import torch

from perception.control.ego_state import ControlNetConfig, state_size
from perception.control.runtime import ControlEstimate, OnnxControlStudent, decode
from perception.control.training.network import STUDENT_FILES, ControlNet
from perception.control.training.run import (
    ControlTrainingConfig,
    choice_loss,
    predict_control,
    train_control,
)
from perception.control.training.samples import ControlSamples, score_control
from perception.networks.training.network_files import parameter_count
from perception.networks.weights_file import read_weights, write_weights
from perception.segmentation.training.unet import UNet, UNetConfig
from tests.perception.control.control_world import TINY, made_up_flight
from tests.perception.networks.small_networks import shaken
from uav_bt.errors import AnswerError, ValueRangeError, WeightsError

RNG = np.random.default_rng(3)
PICTURES = [RNG.integers(0, 256, (16, 32, 3), dtype=np.uint8) for _ in range(3)]
NUMBERS = RNG.normal(size=state_size(3)).astype(np.float32)


def seeded(config: ControlNetConfig = TINY) -> ControlNet:
    torch.manual_seed(1)
    return shaken(ControlNet(config))


@pytest.fixture(scope="module")
def weights(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("student") / "student.safetensors"
    STUDENT_FILES.save(path, seeded(), notes={"steps": 3})
    STUDENT_FILES.export(path, path.with_suffix(".onnx"))
    return path


def test_the_size_is_smaller_than_the_papers_and_a_shape_that_cannot_be_is_refused() -> None:
    """1.6 million parameters there."""
    assert parameter_count(ControlNet(ControlNetConfig())) < 900_000
    for changed in ({"views": 0}, {"spacing_s": 0.0}):
        with pytest.raises(ValueRangeError, match="views and their spacing must be positive"):
            replace(TINY, **changed)


def test_views_are_seen_in_their_order_and_may_be_one() -> None:
    frames, told, net = torch.rand(1, 3, 3, 16, 32), torch.zeros(1, state_size(3)), seeded()
    with torch.inference_mode():
        assert not torch.allclose(net(frames, told), net(frames.flip(1), told))
    alone = seeded(replace(TINY, views=1))
    assert alone(torch.rand(2, 1, 3, 16, 32), torch.zeros(2, state_size(1))).shape == (2, 5)


def test_what_flies_says_what_was_trained_in_integers_almost(weights: Path, tmp_path: Path) -> None:
    """The parity of torch's network and its ONNX file, to the rounding of floats."""
    net, notes = STUDENT_FILES.load(weights)
    assert (net.config, notes) == (TINY, {"steps": 3})
    frames = torch.from_numpy(np.stack(PICTURES)).permute(0, 3, 1, 2)[None].float() / 255.0
    with torch.inference_mode():
        wanted = decode(seeded()(frames, torch.from_numpy(NUMBERS)[None]).numpy()[0])
    student = OnnxControlStudent(weights.with_suffix(".onnx"))
    assert (student.config, student.size_px) == (TINY, (32, 16))
    assert astuple(student.estimate(PICTURES, NUMBERS)) == pytest.approx(astuple(wanted), abs=1e-5)
    STUDENT_FILES.export(weights, tmp_path / "int8.onnx", calibration=PICTURES)
    got = OnnxControlStudent(tmp_path / "int8.onnx").estimate(PICTURES, NUMBERS)
    assert got != student.estimate(PICTURES, NUMBERS)
    assert (got.advance, got.step_m) == pytest.approx((wanted.advance, wanted.step_m), abs=0.03)
    # A choice is described by shares and metres.
    said = decode(np.array([0.0, 2.0, 0.7, -3.0, 0.9]))
    assert astuple(said) == pytest.approx((0.5, 0.881, 0.7, 0.047, 0.9), abs=1e-3)


def test_weights_of_another_version_or_without_a_layer_are_refused(
    weights: Path, tmp_path: Path
) -> None:
    tensors, details = read_weights(weights, kind="control-student", remedy="")
    other, part = tmp_path / "other.safetensors", tmp_path / "part.safetensors"
    write_weights(other, tensors, kind="control-student", details={**details, "version": 0})
    del tensors["head.bias"]
    write_weights(part, tensors, kind="control-student", details=details)
    for path, message in (
        (other, "of version 2, got 0; `uav-bt net train"),
        (part, r"(?s)is not a complete network .*head\.bias"),
    ):
        with pytest.raises(WeightsError, match=message):
            STUDENT_FILES.export(path, tmp_path / "n.onnx")


def test_numbers_that_are_none_are_errors(weights: Path, tmp_path: Path) -> None:
    """Never a silent zero: in the answer, and in telemetry."""
    model, path = onnx.load(weights.with_suffix(".onnx")), tmp_path / "nan.onnx"
    (bias,) = [one for one in model.graph.initializer if one.name == "head.bias"]
    bias.CopyFrom(onnx.numpy_helper.from_array(np.full(5, np.nan, np.float32), bias.name))
    path.write_bytes(model.SerializeToString())
    with pytest.raises(AnswerError, match="answer holds NaN or infinity"):
        OnnxControlStudent(path).estimate(PICTURES, NUMBERS)
    with pytest.raises(ValueRangeError, match="state must be finite numbers"):
        OnnxControlStudent(path).estimate(PICTURES, np.full_like(NUMBERS, np.nan))


# --- training of the control student --------------------------------------------------------------

QUICK = ControlTrainingConfig(
    steps=200, batch=8, warm_up_steps=10, learning_rate=1e-2, average=0.9, dropout=0.0
)
SHORT = replace(QUICK, steps=6, checkpoint_every=3)


def test_it_learns_what_the_rule_does() -> None:
    """On views that it has not seen."""
    net = train_control(ControlSamples([made_up_flight(1)], TINY), QUICK, TINY)
    unseen = ControlSamples([made_up_flight(2)], TINY)
    score = score_control(lambda batch: predict_control(net, batch), unseen)
    assert score.windows == 60
    assert (score.missed, score.stopped, score.wrong_side) == (0.0, 0.0, 0.0)
    assert score.step_error_m < 0.15


def test_the_checkpoint_of_another_run_is_refused(tmp_path: Path) -> None:
    kept = tmp_path / "checkpoint.safetensors"
    train_control(ControlSamples([made_up_flight(1)], TINY), SHORT, TINY, checkpoint=kept)
    more = ControlSamples([made_up_flight(1), made_up_flight(2)], TINY)
    with pytest.raises(WeightsError, match="other settings or data; delete the file"):
        train_control(more, SHORT, TINY, checkpoint=kept)


def test_it_begins_with_the_weights_it_is_given() -> None:
    """The encoder of a segmentation U-Net, for instance; what that lacks begins at random."""
    unet = UNet(UNetConfig(width_px=32, height_px=16, channels=TINY.channels, outputs=17), ())
    start = {name: value.numpy() for name, value in unet.state_dict().items()}
    held = replace(SHORT, steps=1, learning_rate=1e-12, weight_decay=0.0)
    net = train_control(ControlSamples([made_up_flight(1)], TINY), held, TINY, start=start)
    begun = net.state_dict()["down.0.0.weight"].numpy()
    assert begun == pytest.approx(start["down.0.0.weight"], abs=1e-6)


def test_the_score_tells_misses_from_stops() -> None:
    """A network that always goes on misses all that is blocked, and never stops."""
    samples = ControlSamples([made_up_flight(1)], TINY)
    always = ControlEstimate(advance=1.0, clockwise=1.0, step_m=1.0, ground_ends=0.0, free_m=1.0)
    score = score_control(lambda batch: [always] * len(batch.labels), samples)
    assert (score.missed, score.stopped) == (1.0, 0.0)
    assert score.step_error_m == pytest.approx(0.2, abs=1e-6)
    assert score.step_excess_m == pytest.approx(0.2, abs=1e-6)
    assert 0.2 < score.wrong_side < 0.8
    assert score.wrong_end == 0.0


def loss(said: list[float], label: list[float], turning: float = 0.0) -> float:
    """The loss of advance, clockwise, step, end and free path said, for what the rule answered."""
    rows = (torch.tensor([row], dtype=torch.float32) for row in (said, label))
    return float(choice_loss(*rows, torch.tensor([turning])))


FREE, BLOCKED = [0.8, 0.0, 0.0, 1.0], [0.0, 0.5, 0.0, 0.0]


def test_an_unknown_free_way_is_not_learnt_from() -> None:
    said = [5.0, 0.0, 0.8, -5.0, 0.1]
    untold = loss(said, [0.8, 0.0, 0.0, math.nan])
    assert math.isfinite(untold)
    assert untold < loss(said, FREE)


def test_a_right_choice_costs_little_and_a_missed_obstacle_most() -> None:
    go, turn = [4.0, 4.0, 0.8, -4.0, 1.0], [-4.0, 4.0, 0.8, -4.0, 1.0]
    assert loss(go, FREE) < 0.1
    missed, stopped = loss(go, BLOCKED) - loss(turn, BLOCKED), loss(turn, FREE) - loss(go, FREE)
    assert missed > 1.3 * stopped


def test_the_side_of_a_turn_under_way_teaches_nothing() -> None:
    left, right = [-4.0, -4.0, 0.0, -4.0, 0.0], [-4.0, 4.0, 0.0, -4.0, 0.0]
    assert loss(left, BLOCKED) > loss(right, BLOCKED) + 1
    assert loss(left, BLOCKED, turning=1.0) == loss(right, BLOCKED, turning=1.0)


def test_a_step_too_long_costs_more_than_one_too_short() -> None:
    label = [0.6, 0.0, 0.0, 1.0]
    assert loss([4.0, 0.0, 0.8, -4.0, 1.0], label) > loss([4.0, 0.0, 0.4, -4.0, 1.0], label)
