"""The playback of a record equals the flight in each tick's record, board and statuses."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.uav_bt.app.view.recorded_world import Seen
from uav_bt.record.playback import Playback
from uav_bt.record.reader import RecordReader
from uav_bt.types import ClassMap, Frame, NearObstacles


@pytest.fixture
def playback(flown: tuple[Path, Seen]) -> Playback:
    return Playback(RecordReader(flown[0]))


def plain(value: Any) -> Any:
    """Return a value that can be compared: arrays as lists."""
    match value:
        case Frame():
            return (value.index, value.captured_s, value.image.tobytes())
        case ClassMap():
            return (value.captured_s, value.ids.tobytes())
        case NearObstacles():
            return (value.captured_s, value.points_m.tolist(), value.unplaced_rad.tolist())
        case _:
            return value


def test_the_ticks_are_those_that_were_flown(flown: tuple[Path, Seen], playback: Playback) -> None:
    seen = flown[1]
    ticks = list(playback.ticks())
    assert len(ticks) == len(seen.ticks) > 50
    for again, live in zip(ticks, seen.ticks, strict=True):
        for name in ("index", "time_s", "tree_status", "phase", "active", "command", "truth"):
            assert getattr(again, name) == getattr(live, name), (live.index, name)
        assert again.observation.state == live.observation.state
        assert plain(again.observation.frame) == plain(live.observation.frame)
        assert (again.feedback, again.compute_s) == (live.feedback, live.compute_s)


def test_board_and_statuses_are_those_after_each_tick(
    flown: tuple[Path, Seen], playback: Playback
) -> None:
    seen = flown[1]
    names = ("class_map", "mark", "phase", "elapsed_s", "frame")
    for tick, board, statuses in zip(playback.ticks(), seen.boards, seen.statuses, strict=True):
        again = playback.board.snapshot()
        for name in names:
            live = board.get(name)
            known = again.get(name)
            assert (known is None) == (live is None), (tick.index, name)
            if known is not None and live is not None:
                assert plain(known[0]) == plain(live[0]), (tick.index, name)
                assert known[1] == live[1], (tick.index, name)
        assert dict(playback.statuses()) == statuses, tick.index


def test_the_site_map_is_at_most_half_a_second_old(
    flown: tuple[Path, Seen], playback: Playback
) -> None:
    seen, compared = flown[1], 0
    for _, board in zip(playback.ticks(), seen.boards, strict=True):
        again, live = (known.get("site_map") for known in (playback.board.snapshot(), board))
        assert (again is None) == (live is None)
        if again is not None and live is not None:
            assert 0.0 <= live[0].captured_s - again[0].captured_s <= 0.6
            assert again[0].restarts == live[0].restarts
            assert plain(again[0].near) == plain(live[0].near)  # recorded in every tick
            compared += 1
    assert compared > 20


def test_a_part_begins_and_ends_at_the_given_times(playback: Playback) -> None:
    start_s = playback.start_s
    times = np.array([tick.time_s for tick in playback.ticks(from_s=2.0, to_s=3.0)])
    assert len(times) == 10
    assert (times - start_s >= 2.0 - 1e-9).all()
    assert (times - start_s < 3.0).all()
