"""Messages of a tree among the flight's events."""

from __future__ import annotations

import pytest

from behaviours.fly.say import Say
from uav_bt.board import ELAPSED, PHASE
from uav_bt.errors import InputError
from uav_bt.testing import LeafBench
from uav_bt.tree import Status
from uav_bt.types import MissionPhase
from uav_bt.types.flight_results import EventKind, FlightEvent


def test_variables_and_board_keys_are_filled_in() -> None:
    text = "{side} of {count}, {share}, after {@elapsed_s} s in phase {@phase}"
    bench = LeafBench(Say, text=text)
    bench.board[ELAPSED] = 12.0
    bench.board[PHASE] = MissionPhase.EXPLORE
    bench.variables["side"], bench.variables["count"] = "left", 4
    bench.variables["share"] = 0.12345
    assert bench.tick() is Status.SUCCESS
    filled = "left of 4, 0.123, after 12 s in phase explore"
    assert bench.notes.events == [
        FlightEvent(time_s=12.0, kind=EventKind.INFO, text=filled, node="Bench/Say")
    ]
    assert bench.feedback == filled


def test_a_name_without_a_value_is_unknown() -> None:
    bench = LeafBench(Say, text="{nothing} and {@mark} {@phase}", level="warning")
    assert bench.tick() is Status.SUCCESS
    (event,) = bench.notes.events
    assert (event.kind, event.text) == (EventKind.WARNING, "unknown and unknown unknown")


def test_a_text_of_one_placeholder_is_filled_in_too() -> None:
    bench = LeafBench(Say, text="{n}")
    bench.variables["n"] = 2.5
    bench.tick()
    assert bench.notes.events[0].text == "2.5"


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("50 } %", "'}' belongs to no placeholder"),
        ("{two words}", "'{' belongs to no placeholder"),
        ("{}", "'{' belongs to no placeholder"),
    ],
)
def test_a_bad_text_is_refused(text: str, why: str) -> None:
    with pytest.raises(InputError, match=why):
        Say(None, text=text)


def test_each_activation_adds_one_event() -> None:
    bench = LeafBench(Say, text="again")
    for _ in range(3):
        bench.tick()
    assert [event.text for event in bench.notes.events] == ["again"] * 3
