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


def test_ticks_board_and_statuses_are_those_that_were_flown(
    flown: tuple[Path, Seen], playback: Playback
) -> None:
    seen, compared, count = flown[1], 0, 0
    lives = zip(playback.ticks(), seen.ticks, seen.boards, seen.statuses, strict=True)
    for again, live, board, statuses in lives:
        count += 1
        for name in ("index", "time_s", "tree_status", "phase", "active", "command", "truth"):
            assert getattr(again, name) == getattr(live, name), (live.index, name)
        assert again.observation.state == live.observation.state
        assert plain(again.observation.frame) == plain(live.observation.frame)
        assert (again.feedback, again.compute_s) == (live.feedback, live.compute_s)
        assert dict(playback.statuses()) == statuses, live.index
        kept = playback.board.snapshot()
        for name in ("class_map", "mark", "phase", "elapsed_s", "frame", "site_map"):
            assert (name in kept) == (name in board), (live.index, name)
        for name in {"class_map", "mark", "phase", "elapsed_s", "frame"} & kept.keys():
            assert plain(kept[name][0]) == plain(board[name][0]), (live.index, name)
            assert kept[name][1] == board[name][1], (live.index, name)
        if "site_map" in kept:  # two per second are recorded, obstacles in every tick
            ours, theirs = kept["site_map"][0], board["site_map"][0]
            assert 0.0 <= theirs.captured_s - ours.captured_s <= 0.6
            assert ours.restarts == theirs.restarts
            assert plain(ours.near) == plain(theirs.near)
            compared += 1
    assert count > 50
    assert compared > 20


def test_a_part_begins_and_ends_at_the_given_times(playback: Playback) -> None:
    start_s = playback._reader.timeline.start_s
    times = np.array([tick.time_s for tick in playback.ticks(from_s=2.0, to_s=3.0)])
    assert len(times) == 10
    assert (times - start_s >= 2.0 - 1e-9).all()
    assert (times - start_s < 3.0).all()
