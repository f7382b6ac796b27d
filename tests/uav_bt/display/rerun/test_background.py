"""Drawing in another thread: nothing waits for it, nothing it does brings the flight down."""

from __future__ import annotations

import logging
import threading
from collections.abc import Mapping

import pytest

from tests.uav_bt.display.rerun.rerun_world import World
from uav_bt.board import PHASE
from uav_bt.board.blackboard import Blackboard
from uav_bt.display.rerun.background import BackgroundFollower, Statuses
from uav_bt.mission.runner import TickRecord
from uav_bt.tree import Status


class Follower:
    """Notes what the board and the statuses said when it was told of a tick."""

    def __init__(self, board: Blackboard, statuses: Statuses) -> None:
        self._board, self._statuses = board, statuses
        self.seen: list[tuple[int, str | None, Mapping[str, Status]]] = []
        self.told = threading.Event()
        self.may_go_on = threading.Event()
        self.may_go_on.set()

    def on_tick(self, record: TickRecord) -> None:
        self.told.set()
        assert self.may_go_on.wait(30.0)
        self.seen.append((record.index, self._board.read(PHASE).value, self._statuses()))


class Bench:
    """A mission whose ticks are followed in the background."""

    def __init__(self, waiting_ticks: int = 32) -> None:
        self.world = World()
        self.standing: dict[str, Status] = {}
        self.follower: Follower
        self.background = BackgroundFollower(
            self._make, self.world.board, lambda: self.standing, waiting_ticks=waiting_ticks
        )

    def _make(self, board: Blackboard, statuses: Statuses) -> Follower:
        self.follower = Follower(board, statuses)
        return self.follower

    def tick(self, phase: str) -> None:
        self.world.board.write(PHASE, phase)
        self.standing["root"] = Status.RUNNING if phase == "one" else Status.SUCCESS
        self.background.on_tick(self.world.tick())


def test_a_late_follower_sees_the_board_as_it_was() -> None:
    bench = Bench()
    bench.follower.may_go_on.clear()
    bench.tick("one")
    bench.tick("two")
    bench.world.board.forget(PHASE)
    bench.background.on_tick(bench.world.tick())
    bench.follower.may_go_on.set()
    bench.background.close()
    assert bench.follower.seen == [
        (0, "one", {"root": Status.RUNNING}),
        (1, "two", {"root": Status.SUCCESS}),
        (2, None, {"root": Status.SUCCESS}),
    ]


def test_what_there_is_no_time_for_is_left_out_and_told(
    caplog: pytest.LogCaptureFixture,
) -> None:
    bench = Bench(waiting_ticks=2)
    bench.follower.may_go_on.clear()
    bench.tick("one")
    assert bench.follower.told.wait(30.0)  # the thread is busy with it
    for phase in ("two", "three", "four", "five"):
        bench.tick(phase)
    assert bench.background.left_out == 2
    bench.follower.may_go_on.set()
    with caplog.at_level(logging.WARNING):
        bench.background.close()
    assert [phase for _, phase, _ in bench.follower.seen] == ["one", "two", "three"]
    assert "left out 2 ticks" in caplog.text


def test_a_follower_that_raises_is_left_alone(caplog: pytest.LogCaptureFixture) -> None:
    bench = Bench()

    def fail(_: TickRecord) -> None:
        raise ValueError("the window is gone")

    bench.follower.on_tick = fail  # type: ignore[method-assign]
    with caplog.at_level(logging.WARNING):
        bench.tick("one")
        bench.tick("two")
        bench.background.close()
    assert isinstance(bench.background.failure, ValueError)
    assert caplog.text.count("the window is gone") == 1
    bench.tick("three")  # and says no more
    bench.background.close()
