"""Training of the control student: it learns, and its losses."""

import math
from dataclasses import replace
from pathlib import Path

import pytest
import torch

from perception.control.runtime import ControlEstimate
from perception.control.training.run import (
    ControlTrainingConfig,
    choice_loss,
    predict_control,
    train_control,
)
from perception.control.training.samples import ControlSamples, score_control
from perception.segmentation.training.unet import UNet, UNetConfig
from tests.perception.control.control_world import TINY, made_up_flight
from uav_bt.errors import WeightsError

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
