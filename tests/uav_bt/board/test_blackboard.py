"""The mission's blackboard: types, ages and declared access."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from uav_bt.board.blackboard import Blackboard, BoardView, Key
from uav_bt.clock import ManualClock
from uav_bt.errors import BoardAccessError

SPEED = Key("speed_mps", float, "how fast", unit="m/s", max_age_s=0.5)
NAME = Key("name", str, "what it is called")
COUNT = Key("count", int, "how many")


@pytest.fixture
def board(manual_clock: ManualClock) -> Blackboard:
    return Blackboard(manual_clock, (SPEED, NAME, COUNT))


def test_what_was_never_written_is_unknown_and_infinitely_old(board: Blackboard) -> None:
    reading = board.read(SPEED)
    assert not reading.known
    assert reading.value is None
    assert math.isinf(reading.age_s)


def test_a_value_reads_as_none_once_it_is_too_old(
    board: Blackboard, manual_clock: ManualClock
) -> None:
    """A value is fresh up to the age limit; its age is known after it, too."""
    board.write(SPEED, 1.5)
    manual_clock.advance(0.5)
    assert board.read(SPEED).value == 1.5
    manual_clock.advance(0.01)
    stale = board.read(SPEED)
    assert not stale.known
    assert stale.age_s == pytest.approx(0.51)


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


def test_age_counts_from_the_capture_and_not_from_the_writing(
    board: Blackboard, manual_clock: ManualClock
) -> None:
    manual_clock.advance(2.0)
    board.write(SPEED, 1.0, captured_s=1.8)
    assert board.read(SPEED).age_s == pytest.approx(0.2)
    board.write(SPEED, 1.0, captured_s=1.0)
    assert not board.read(SPEED).known


def test_a_falsy_value_is_known(board: Blackboard) -> None:
    board.write(COUNT, 0)
    assert board.read(COUNT).known


def test_a_float_key_takes_whole_numbers_and_numpys_floats(board: Blackboard) -> None:
    board.write(SPEED, 2)
    assert board.read(SPEED).value == 2
    board.write(SPEED, np.float64(0.25))
    assert board.read(SPEED).value == 0.25


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        (SPEED, "fast", "'speed_mps' holds float, got str"),
        (SPEED, True, "'speed_mps' holds float, got bool"),
        (COUNT, True, "'count' holds int, got bool"),
        (COUNT, 1.0, "'count' holds int, got float"),
        (NAME, None, "'name' holds str, got NoneType"),
    ],
)
def test_a_value_of_another_type_is_refused_and_the_old_one_stays(
    board: Blackboard, key: Key[object], value: object, said: str
) -> None:
    board.write(NAME, "before")
    with pytest.raises(BoardAccessError, match=said):
        board.write(key, value)
    assert board.read(NAME).value == "before"


def test_a_key_that_nobody_declared_is_not_written(board: Blackboard) -> None:
    with pytest.raises(BoardAccessError, match="'depth' was never declared"):
        board.write(Key("depth", float, "how deep"), 1.0)


def test_a_key_of_the_same_name_and_another_type_is_another_key(board: Blackboard) -> None:
    with pytest.raises(BoardAccessError, match="declared twice, differently"):
        board.declare(Key("name", int, "what it is called"))
    with pytest.raises(BoardAccessError, match="never declared"):
        board.write(Key("name", int, "what it is called"), 1)


def test_declaring_a_key_again_changes_nothing(board: Blackboard) -> None:
    board.write(NAME, "kept")
    board.declare(Key("name", str, "what it is called"))
    assert board.read(NAME).value == "kept"
    assert set(board.keys) == {"speed_mps", "name", "count"}


def test_the_keys_are_a_copy(board: Blackboard) -> None:
    board.keys.clear()
    assert board.key("name") == NAME


def test_a_misspelt_key_gets_a_suggestion(board: Blackboard) -> None:
    with pytest.raises(BoardAccessError, match="unknown board key 'nmae'; did you mean 'name'"):
        board.key("nmae")


def test_what_is_forgotten_was_never_written(board: Blackboard) -> None:
    board.write(NAME, "gone")
    board.forget(NAME)
    board.forget(NAME)
    assert math.isinf(board.read(NAME).age_s)
    assert board.snapshot() == {}


def test_a_snapshot_has_every_value_with_its_capture_time(
    board: Blackboard, manual_clock: ManualClock
) -> None:
    """Stale values are included: a record has all values."""
    board.write(SPEED, 1.0)
    manual_clock.advance(9.0)
    board.write(NAME, "x", captured_s=8.5)
    assert board.snapshot() == {"speed_mps": (1.0, 0.0), "name": ("x", 8.5)}


def test_two_boards_do_not_meet(board: Blackboard, manual_clock: ManualClock) -> None:
    board.write(NAME, "mine")
    assert not Blackboard(manual_clock, (NAME,)).read(NAME).known


# --- a leaf's access -----------------------------------------------------------------------------


@pytest.fixture
def view(board: Blackboard) -> BoardView:
    return BoardView(board, "Mission/look", reads=(SPEED,), writes=(NAME,))


def test_a_leaf_reads_and_writes_what_it_declared(board: Blackboard, view: BoardView) -> None:
    board.write(SPEED, 1.0)
    assert view.read(SPEED).value == 1.0
    view.write(NAME, "tower", captured_s=0.0)
    assert board.read(NAME).value == "tower"
    view.forget(NAME)
    assert not board.read(NAME).known


def test_a_leaf_may_read_what_it_writes(view: BoardView) -> None:
    view.write(NAME, "tower")
    assert view.read(NAME).value == "tower"


def test_reading_without_declaring_names_leaf_and_key_and_cure(view: BoardView) -> None:
    with pytest.raises(BoardAccessError, match=r"'Mission/look' reads .*'count'.* its `reads`"):
        view.read(COUNT)


def test_a_leaf_that_only_reads_a_key_may_neither_write_nor_forget_it(
    board: Blackboard, view: BoardView
) -> None:
    board.write(SPEED, 1.0)
    with pytest.raises(BoardAccessError, match=r"'Mission/look' writes .*'speed_mps'.* `writes`"):
        view.write(SPEED, 2.0)
    with pytest.raises(BoardAccessError, match="'speed_mps'"):
        view.forget(SPEED)
    assert board.read(SPEED).value == 1.0


def test_a_wrong_type_names_the_leaf(view: BoardView) -> None:
    wrong: Any = 3
    with pytest.raises(BoardAccessError, match=r"leaf 'Mission/look': .*holds str, got int"):
        view.write(NAME, wrong)
