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


def test_a_value_reads_as_none_once_it_is_too_old(
    board: Blackboard, manual_clock: ManualClock
) -> None:
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
    with pytest.raises(BoardAccessError, match="unknown board key 'nmae'; did you mean 'name'"):
        board.key("nmae")


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
