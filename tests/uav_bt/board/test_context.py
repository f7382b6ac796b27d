"""What a leaf is given when its mission sets up."""

from __future__ import annotations

import pytest

from uav_bt.board.blackboard import Blackboard
from uav_bt.board.context import MissionContext, Proposals
from uav_bt.clock import ManualClock


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
    """The same leaf of the same mission draws the same, whoever drew before."""
    assert draw(1, "Mission/Explore") == draw(1, "Mission/Explore")
    draws = {draw(seed, owner) for seed in (1, 2) for owner in ("Mission/a", "Mission/b")}
    assert len(draws) == 4
