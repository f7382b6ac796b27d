"""What the control student minimises."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from perception.control.training.losses import choice_loss

NAN = math.nan


def rows(*numbers: list[float]) -> Tensor:
    return torch.tensor(numbers, dtype=torch.float32)


def test_an_untold_free_way_is_not_learnt_from() -> None:
    said = rows([5.0, 0.0, 0.8, -5.0, 0.1])
    near, far = rows([0.8, 0.0, 0.0, NAN]), rows([0.8, 0.0, 0.0, 1.0])
    untold, told = (float(choice_loss(said, label, torch.zeros(1))) for label in (near, far))
    assert math.isfinite(untold)
    assert untold < told


def test_a_right_choice_costs_little_and_a_missed_obstacle_most() -> None:
    free, blocked = rows([0.8, 0.0, 0.0, 1.0]), rows([0.0, 0.5, 0.0, 0.0])
    go, turn = rows([4.0, 4.0, 0.8, -4.0, 1.0]), rows([-4.0, 4.0, 0.8, -4.0, 1.0])
    still = torch.zeros(1)
    assert float(choice_loss(go, free, still)) < 0.1
    missed, stopped = (
        float(choice_loss(said, label, still) - choice_loss(right, label, still))
        for said, label, right in ((go, blocked, turn), (turn, free, go))
    )
    assert missed > 1.3 * stopped


def test_the_side_of_a_turn_under_way_teaches_nothing() -> None:
    blocked = rows([0.0, 0.5, 0.0, 0.0])
    left, right = rows([-4.0, -4.0, 0.0, -4.0, 0.0]), rows([-4.0, 4.0, 0.0, -4.0, 0.0])
    begins, under_way = torch.zeros(1), torch.ones(1)
    assert (
        float(choice_loss(left, blocked, begins)) > float(choice_loss(right, blocked, begins)) + 1
    )
    assert torch.equal(
        choice_loss(left, blocked, under_way), choice_loss(right, blocked, under_way)
    )


def test_a_step_too_long_costs_more_than_one_too_short() -> None:
    free = rows([0.6, 0.0, 0.0, 1.0])
    long, short = rows([4.0, 0.0, 0.8, -4.0, 1.0]), rows([4.0, 0.0, 0.4, -4.0, 1.0])
    still = torch.zeros(1)
    assert float(choice_loss(long, free, still)) > float(choice_loss(short, free, still))
