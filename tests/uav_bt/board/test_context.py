"""The context that a leaf gets at the setup of its mission."""

from __future__ import annotations

from typing import Any

import pytest

from uav_bt.board.blackboard import Blackboard
from uav_bt.board.context import MissionContext, Proposals
from uav_bt.clock import ManualClock
from uav_bt.types import HOVER, Hover


def draw(seed: int, owner: str) -> float:
    clock = ManualClock()
    context = MissionContext(
        board=Blackboard(clock, ()),
        clock=clock,
        proposals=Proposals(),
        policy=lambda name: pytest.fail(f"asked for policy {name}"),
        seed=seed,
    )
    return float(context.rng(owner).random())


def test_chance_depends_on_the_seed_and_the_owner_and_on_nothing_else() -> None:
    """A leaf's random numbers do not depend on the draws of other leaves."""
    assert draw(1, "Mission/Explore") == draw(1, "Mission/Explore")
    draws = {draw(seed, owner) for seed in (1, 2) for owner in ("Mission/a", "Mission/b")}
    assert len(draws) == 4


@pytest.mark.parametrize("wrong", [None, "up", Hover, HOVER])
def test_only_movements_are_proposed(wrong: Any) -> None:
    """A leaf that proposes something else fails at that call."""
    with pytest.raises(TypeError, match=r"expected a movement \(TakeOff or .*\), got "):
        Proposals().propose("Mission/a", wrong)
    with pytest.raises(TypeError, match=r"expected a camera direction \(GimbalTo\), got "):
        Proposals().propose_gimbal("Mission/a", wrong)
