"""The whole view of a flight: one timeline, changed words, a layout without empty panes."""

from __future__ import annotations

import logging
import threading
from collections.abc import Mapping

import pytest
from rerun.blueprint import GraphView, Spatial2DView, Vertical, View

from tests.uav_bt.display.display_world import World
from tests.uav_bt.display.rerun.rerun_world import NotedStream, setting, values
from tests.uav_bt.display.test_live_map import believed
from uav_bt.board import PHASE, SITE_MAP
from uav_bt.board.blackboard import Blackboard
from uav_bt.display.rerun.flight_view import BackgroundFollower, FlightView, Statuses
from uav_bt.display.rerun.layout import layout
from uav_bt.mission.safety import Override
from uav_bt.mission.tick import TickRecord
from uav_bt.tree import Status


def flight_view(stream: NotedStream, world: World, **told: float) -> FlightView:
    statuses = {"Main/root": Status.RUNNING}
    return FlightView(stream, setting(), world.board, lambda: statuses, **told)


def test_time_begins_with_the_first_tick() -> None:
    stream, world = NotedStream(), World(start_s=40.0)
    view = flight_view(stream, world)
    for _ in range(3):
        view.on_tick(world.tick())
    times = [note.time_s for note in stream.of("plots/tick_time/compute")[1:]]
    assert times == pytest.approx([0.0, 0.1, 0.2])
    assert stream.names == ["tour"]


def test_time_begins_at_the_given_time() -> None:
    stream, world = NotedStream(), World(start_s=40.0)
    flight_view(stream, world, start_s=30.0).on_tick(world.tick())
    assert stream.of("plots/tick_time/compute")[-1].time_s == pytest.approx(10.0)


def test_texts_are_logged_when_they_change_and_overrides_warn() -> None:
    stream, world = NotedStream(), World()
    view = flight_view(stream, world)
    view.on_tick(world.tick())
    view.on_tick(world.tick())
    view.on_tick(world.tick(override=Override.STALE_FRAME))
    said = stream.of("words")
    assert [values(note.thing.level) for note in said] == [["INFO"], ["WARN"]]
    assert values(said[0].thing.text) == ["explore: Explore (clear): hover"]
    assert Override.STALE_FRAME.value in values(said[1].thing.text)[0]


def test_a_flight_without_a_frame_is_drawn() -> None:
    stream, world = NotedStream(), World()
    flight_view(stream, world).on_tick(world.tick(frame=False))
    assert stream.of("world/camera/image") == []
    assert stream.of("world/drone")


def views(part: object) -> list[View]:
    inner = getattr(part, "contents", None)
    if isinstance(part, View):
        return [part]
    return [view for below in inner or () for view in views(below)]


def test_the_layout_has_a_pane_for_everything() -> None:
    root = layout(setting()).root_container
    assert isinstance(root, Vertical)
    names = [view.name for view in views(root)]
    assert names == [
        *("Camera", "Mask", "Metric depth", "tour", "Words", "Tree"),
        *("Heading error, deg", "Height, m", "Free distance, m", "Tick time, ms"),
    ]


def test_a_mission_that_keeps_a_map_gets_a_pane_for_it() -> None:
    names = [view.name for view in views(layout(setting(makes_map=True)).root_container)]
    assert "Site map" in names
    stream, world = NotedStream(), World()
    world.board.write(SITE_MAP, believed())
    flight_view(stream, world).on_tick(world.tick())
    assert len(stream.of("site_map")) == 1


def test_panes_that_would_stay_empty_are_left_out() -> None:
    found = views(layout(setting(makes_depth=False, tree=())).root_container)
    assert not [view for view in found if isinstance(view, GraphView)]
    assert [view.name for view in found if isinstance(view, Spatial2DView)] == ["Camera", "Mask"]


class Follower:
    """Records the board and the statuses at each tick."""

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
    """A mission with a background follower of its ticks."""

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


def test_ticks_that_take_too_long_are_omitted_and_reported(
    caplog: pytest.LogCaptureFixture,
) -> None:
    bench = Bench(waiting_ticks=2)
    bench.follower.may_go_on.clear()
    bench.tick("one")
    assert bench.follower.told.wait(30.0)  # the thread is busy with this tick
    for phase in ("two", "three", "four", "five"):
        bench.tick(phase)
    assert bench.background.left_out == 2
    bench.follower.may_go_on.set()
    with caplog.at_level(logging.WARNING):
        bench.background.close()
    assert [phase for _, phase, _ in bench.follower.seen] == ["one", "two", "three"]
    assert "dropped 2 ticks" in caplog.text


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
    bench.tick("three")  # has no effect
    bench.background.close()
