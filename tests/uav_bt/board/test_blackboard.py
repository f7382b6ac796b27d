"""The blackboard, a mission's context, and what leaves the board: plain values and files."""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgpack
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uav_bt.board import ELAPSED
from uav_bt.board.blackboard import Blackboard, BoardView, Key
from uav_bt.board.context import FlightFolder, FlightNotes, MissionContext, Proposals
from uav_bt.board.plain_values import plain
from uav_bt.clock import ManualClock
from uav_bt.errors import BoardAccessError, FileError
from uav_bt.types import HOVER, Hover
from uav_bt.types.flight_results import EventKind, FlightEvent

SPEED = Key("speed_mps", float, "how fast", unit="m/s", max_age_s=0.5)
NAME = Key("name", str, "what it is called")
COUNT = Key("count", int, "how many")


@pytest.fixture
def board(manual_clock: ManualClock) -> Blackboard:
    return Blackboard(manual_clock, (SPEED, NAME, COUNT))


def test_a_value_too_old_reads_as_none(board: Blackboard, manual_clock: ManualClock) -> None:
    """Age counts from the capture. What was forgotten was never written."""
    assert not board.read(SPEED).known
    manual_clock.advance(2.0)
    board.write(SPEED, 1.5, captured_s=1.8)
    assert board.read(SPEED).age_s == pytest.approx(0.2)
    manual_clock.advance(0.3)
    assert board.read(SPEED).value == board.value(SPEED) == 1.5
    manual_clock.advance(0.01)
    stale = board.read(SPEED)
    assert (stale.known, stale.value, board.value(SPEED)) == (False, None, None)
    assert stale.age_s == pytest.approx(0.51)
    board.forget(SPEED)
    board.forget(SPEED)
    assert math.isinf(board.read(SPEED).age_s)


def test_an_age_is_a_sum_of_ticks_and_no_rounding_makes_it_stale(
    board: Blackboard, manual_clock: ManualClock
) -> None:
    late = 0
    for _ in range(60):
        written_s = manual_clock.now()
        board.write(SPEED, 1.0)
        for _ in range(5):
            manual_clock.advance(0.1)
        late += manual_clock.now() - written_s > 0.5
        assert board.read(SPEED).known
    assert late > 0  # rounding errors did exceed the limit


@pytest.mark.parametrize(
    ("key", "value"), [(COUNT, 0), (SPEED, 2), (SPEED, np.float64(0.25)), (NAME, "")]
)
def test_values_that_are_taken(board: Blackboard, key: Key[object], value: object) -> None:
    board.write(key, value)
    assert board.read(key).known
    assert board.value(key) == value


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        (SPEED, "fast", "'speed_mps' holds float, got str"),
        (SPEED, True, "'speed_mps' holds float, got bool"),
        (COUNT, True, "'count' holds int, got bool"),
        (COUNT, 1.0, "'count' holds int, got float"),
        (NAME, None, "'name' holds str, got NoneType"),
        (Key("depth", float, "how deep"), 1.0, "'depth' was never declared"),
        (Key("name", int, "what it is called"), 1, "'name' was never declared"),
    ],
)
def test_another_value_is_refused_and_the_old_one_stays(
    board: Blackboard, key: Key[object], value: object, said: str
) -> None:
    board.write(NAME, "before")
    with pytest.raises(BoardAccessError, match=said):
        board.write(key, value)
    assert board.snapshot() == {"name": ("before", 0.0)}


def test_a_key_is_declared_once(board: Blackboard) -> None:
    board.declare(Key("name", str, "what it is called"))
    board.keys.clear()  # a copy
    assert list(board.keys) == ["speed_mps", "name", "count"]
    with pytest.raises(BoardAccessError, match="declared twice, differently"):
        board.declare(Key("name", int, "what it is called"))


def test_a_leaf_has_access_to_what_it_declared(board: Blackboard) -> None:
    """It may read what it writes. A refusal names leaf, key and remedy."""
    view = BoardView(board, "Mission/look", reads=(SPEED,), writes=(NAME,))
    board.write(SPEED, 1.0)
    assert view.read(SPEED).value == view.value(SPEED) == 1.0
    view.write(NAME, "tower", captured_s=0.0)
    assert view.read(NAME).value == "tower"
    view.forget(NAME)
    assert not board.read(NAME).known
    for read in (view.read, view.value):
        with pytest.raises(BoardAccessError, match=r"'Mission/look' reads .*'count'.* its `reads`"):
            read(COUNT)
    with pytest.raises(BoardAccessError, match=r"'Mission/look' writes .*'speed_mps'.* `writes`"):
        view.write(SPEED, 2.0)
    with pytest.raises(BoardAccessError, match="'speed_mps'"):
        view.forget(SPEED)
    assert board.read(SPEED).value == 1.0
    wrong: Any = 3
    with pytest.raises(BoardAccessError, match=r"leaf 'Mission/look': .*holds str, got int"):
        view.write(NAME, wrong)


# --- a mission's context --------------------------------------------------------------------------


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


# --- the folder of a flight -----------------------------------------------------------------------


def test_the_folder_is_made_with_its_first_file(tmp_path: Path) -> None:
    folder = FlightFolder(tmp_path / "new" / "flight")
    assert not folder.folder.exists()
    folder.write("notes.txt", "read")
    folder.write("image.jpg", b"\x00\x01")
    assert (folder.folder / "notes.txt").read_text(encoding="utf-8") == "read"
    assert (folder.folder / "image.jpg").read_bytes() == b"\x00\x01"
    with pytest.raises(FileError, match=r"has files, .* name another one, or empty this one"):
        FlightFolder(folder.folder)
    with pytest.raises(FileError, match="is a file and no folder"):
        FlightFolder(folder.folder / "notes.txt")


@pytest.mark.parametrize(
    "name", ["", ".", "..", "../a", "a/b", "a\\b", "/a", ".hidden", "ä", "a\n"]
)
def test_a_name_that_is_no_plain_name_is_refused(name: str, tmp_path: Path) -> None:
    folder = FlightFolder(tmp_path / "out")
    with pytest.raises(FileError, match="expected letters, digits"):
        folder.write(name, "x")
    assert list(tmp_path.iterdir()) == []


def test_nothing_is_overwritten(tmp_path: Path) -> None:
    folder = FlightFolder(tmp_path, reserved=["report.json"])
    folder.write("a.txt", "first")
    (tmp_path / "link.txt").symlink_to("nowhere.txt")
    for name, said in (("a.txt", "exists"), ("link.txt", "exists"), ("report.json", "another")):
        with pytest.raises(FileError, match=said):
            folder.write(name, "second")
    assert (tmp_path / "a.txt").read_text(encoding="utf-8") == "first"
    assert not (tmp_path / "report.json").exists()


# --- plain values ---------------------------------------------------------------------------------


class Colour(enum.Enum):
    RED = 1


@dataclass(frozen=True)
class Pair:
    left: Any
    right: Any


@pytest.mark.parametrize(
    ("value", "told"),
    [
        (None, None),
        (3, 3),
        (2**70, "71-bit integer"),
        (Colour.RED, "RED"),
        (np.float32(0.5), 0.5),
        (np.bool_(True), True),
        (np.zeros((4, 5, 3), np.uint8), "uint8 array 4x5x3"),
        (b"abc", "3 bytes"),
        ((1, [2]), [1, [2]]),
        ({"a": Pair(1, Colour.RED)}, {"a": {"left": 1, "right": "RED"}}),
        ({1: 2}, {"1": 2}),
        ({3}, [3]),
        (object(), "object"),
        (Pair, "type"),
        ("x" * 600, "x" * 500 + "..."),
        (list(range(100)), [*range(64), "..."]),
        ("\ud800", "?"),
    ],
)
def test_a_value_becomes_plain(value: object, told: object) -> None:
    assert plain(value) == told
    assert type(plain(value)) is type(told)


def test_long_and_deep_values_are_cut() -> None:
    told = plain({str(key): key for key in range(100)})
    assert (len(told), told["..."]) == (65, "100 in all")
    loop: list[Any] = []
    loop.append(loop)
    assert plain(loop) == [[[[[[["..."]]]]]]]


@settings(max_examples=50)
@given(
    st.recursive(
        st.none() | st.booleans() | st.integers() | st.floats() | st.text() | st.binary(),
        lambda inner: st.lists(inner) | st.dictionaries(st.text() | st.integers(), inner),
    )
)
def test_everything_can_be_sent(value: object) -> None:
    assert isinstance(msgpack.packb(plain(value)), bytes)
