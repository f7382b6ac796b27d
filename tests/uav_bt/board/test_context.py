"""The context that a leaf gets at the setup of its mission, and its events."""

from __future__ import annotations

from typing import Any

import pytest

from uav_bt.board import ELAPSED
from uav_bt.board.context import FlightNotes, MissionContext, Proposals
from uav_bt.types import HOVER, Hover
from uav_bt.types.flight_results import EventKind, FlightEvent


def draw(seed: int, owner: str) -> float:
    return float(MissionContext(seed=seed).rng(owner).random())


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


def test_events_have_the_time_since_the_take_off() -> None:
    context = MissionContext()
    context.add_event(EventKind.INFO, "before")
    context.board.write(ELAPSED, 12.34567)
    for _ in range(2):
        context.warn_once("later", "M/say")
    assert context.notes.events == [
        FlightEvent(time_s=0.0, kind=EventKind.INFO, text="before"),
        FlightEvent(time_s=12.346, kind=EventKind.WARNING, text="later", node="M/say"),
    ]
    assert str(context.notes.events[1]) == "12.3 s  warning: later"


def test_a_flight_of_endless_messages_keeps_the_first_ones() -> None:
    notes = FlightNotes()
    for number in range(3000):
        notes.add(FlightEvent(time_s=float(number), kind=EventKind.INFO, text="again"))
    assert "more than 2000 events: further ones are not kept" in notes.events[-1].text
    assert len(notes.events) == len(notes.take()) == 2001
    assert notes.take() == ()
