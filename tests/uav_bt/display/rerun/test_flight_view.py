"""A flight view as a whole: one timeline, words said once, a layout without empty panes."""

from __future__ import annotations

import pytest
from rerun.blueprint import GraphView, Spatial2DView, Vertical, View

from tests.uav_bt.display.rerun.rerun_world import NotedStream, World, setting, values
from uav_bt.display.rerun.flight_view import FlightView
from uav_bt.display.rerun.setting import layout
from uav_bt.mission.safety import Override
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


def test_time_begins_where_it_is_told_to() -> None:
    stream, world = NotedStream(), World(start_s=40.0)
    flight_view(stream, world, start_s=30.0).on_tick(world.tick())
    assert stream.of("plots/tick_time/compute")[-1].time_s == pytest.approx(10.0)


def test_words_are_said_when_they_change_and_overrides_warn() -> None:
    stream, world = NotedStream(), World()
    view = flight_view(stream, world)
    view.on_tick(world.tick())
    view.on_tick(world.tick())
    view.on_tick(world.tick(override=Override.STALE_FRAME))
    said = stream.of("words")
    assert [values(note.thing.level) for note in said] == [["INFO"], ["WARN"]]
    assert values(said[0].thing.text) == ["explore: leaf (clear): hover"]
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
        *("Camera", "Mask", "Metric depth", "Lab", "Words", "Tree"),
        *("Heading error, deg", "Height, m", "Free distance, m", "Tick time, ms"),
    ]


def test_panes_that_would_stay_empty_are_left_out() -> None:
    found = views(layout(setting(makes_depth=False, tree=())).root_container)
    assert not [view for view in found if isinstance(view, GraphView)]
    assert [view.name for view in found if isinstance(view, Spatial2DView)] == ["Camera", "Mask"]
