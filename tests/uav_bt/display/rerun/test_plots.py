"""Plots: heading error of a turn, gaps for unknown values; and the tree graph."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.uav_bt.display.display_world import World
from tests.uav_bt.display.rerun.rerun_world import NODES, NotedStream, values
from tests.worlds.values import corridor
from uav_bt.display.rerun.plots import STATUS_COLOURS, FlightPlots, TreeGraph, TurnLeft, places
from uav_bt.tree import Status
from uav_bt.types import HOVER, Command, MarkFix, MoveBy, NearObstacles, Pose


def turn(id_: int, yaw_rad: float) -> Command:
    return Command(movement=MoveBy(id=id_, yaw_rad=yaw_rad))


def test_what_is_left_of_a_turn_shrinks_as_the_drone_turns() -> None:
    world, left = World(), TurnLeft()
    assert left.after(world.tick(yaw_rad=0.2, command=turn(1, 1.0))) == pytest.approx(1.0)
    assert left.after(world.tick(yaw_rad=0.9, command=turn(1, 1.0))) == pytest.approx(0.3)
    assert left.after(world.tick(yaw_rad=0.9, command=HOVER)) is None


def test_a_new_turn_begins_at_the_heading_of_then_and_wraps() -> None:
    world, left = World(), TurnLeft()
    left.after(world.tick(yaw_rad=0.0, command=turn(1, 1.0)))
    begun = left.after(world.tick(yaw_rad=3.0, command=turn(2, -0.5)))
    assert begun == pytest.approx(-0.5)
    later = left.after(world.tick(yaw_rad=-3.1, command=turn(2, -0.5)))
    assert later == pytest.approx(2.5 + 3.1 - 2 * math.pi)


def test_an_advance_is_no_turn() -> None:
    command = Command(movement=MoveBy(id=3, forward_m=0.3))
    assert TurnLeft().after(World().tick(command=command)) is None


def shown(stream: NotedStream, entity: str) -> float:
    (value,) = values(stream.last(entity).scalars)
    return float(value)


def test_every_series_has_a_name_and_a_point_a_tick() -> None:
    stream = NotedStream()
    plots = FlightPlots(stream)
    series = [note.entity for note in stream.notes]
    assert all(note.static and values(note.thing.names) for note in stream.notes)
    at = Pose(x_m=0.0, y_m=0.0, z_m=1.4, yaw_rad=0.0)
    plots.show(World().tick(pose=at), corridor=None, near=None, fix=None)
    assert {note.entity for note in stream.notes if not note.static} == set(series)
    assert shown(stream, "plots/height/telemetry") == 1.5
    assert shown(stream, "plots/height/true") == pytest.approx(1.4)
    assert shown(stream, "plots/free_distance/clearance") == 0.8
    assert shown(stream, "plots/tick_time/compute") == pytest.approx(1.0)


def test_what_is_known_of_the_way_is_plotted() -> None:
    stream = NotedStream()
    ahead = corridor(1.2, "front", nearest_m=0.7, impact_s=2.0)
    obstacles = NearObstacles(points_m=np.array([[0.3, 0.4]]), captured_s=0.0)
    fix = MarkFix(captured_s=0.0, forward_m=1.0, right_m=1.0, height_m=0.4, detected=True)
    FlightPlots(stream).show(World().tick(), corridor=ahead, near=obstacles, fix=fix)
    assert shown(stream, "plots/free_distance/ahead") == 1.2
    assert shown(stream, "plots/free_distance/intrusion") == 0.7
    assert shown(stream, "plots/free_distance/remembered") == pytest.approx(0.5)
    assert shown(stream, "plots/heading/mark") == pytest.approx(45.0)


@pytest.mark.parametrize("entity", ["heading/turn", "heading/mark", "height/true"])
def test_what_is_not_known_leaves_a_gap(entity: str) -> None:
    stream = NotedStream()
    FlightPlots(stream).show(World().tick(), corridor=None, near=None, fix=None)
    assert math.isnan(shown(stream, f"plots/{entity}"))


def test_a_way_without_an_end_leaves_a_gap() -> None:
    stream = NotedStream()
    free = corridor()
    FlightPlots(stream).show(World().tick(), corridor=free, near=None, fix=None)
    assert math.isnan(shown(stream, "plots/free_distance/ahead"))


STATUSES = {"Main/root": Status.RUNNING, "Main/root/first": Status.FAILURE}


def colour_code(status: Status) -> int:
    red, green, blue = STATUS_COLOURS[status]
    return red << 24 | green << 16 | blue << 8 | 255


def test_each_node_has_a_row_and_children_stand_further_right() -> None:
    found = places(NODES)
    assert [y for _, y in found] == sorted({y for _, y in found})
    lefts = [x - 7.0 * len(node.label) / 2 for (x, _), node in zip(found, NODES, strict=True)]
    assert lefts[0] < lefts[1] == lefts[2] < lefts[3]


def test_a_tree_of_nothing_has_no_places_and_draws_nothing() -> None:
    stream = NotedStream()
    TreeGraph(stream, ()).show({})
    assert places(()) == []
    assert stream.notes == []


def test_edges_lead_from_parents_to_children() -> None:
    stream = NotedStream()
    TreeGraph(stream, NODES)
    (edges,) = stream.of("tree")
    assert edges.static
    assert [(edge["first"], edge["second"]) for edge in values(edges.thing.edges)] == [
        ("Main/root", "Main/root/first"),
        ("Main/root", "Main/root/second"),
        ("Main/root/second", "Main/root/second/leaf"),
    ]


def test_nodes_are_coloured_by_status_and_unnamed_ones_stand_idle() -> None:
    stream = NotedStream()
    TreeGraph(stream, NODES).show(STATUSES)
    nodes = stream.last("tree")
    assert values(nodes.node_ids) == [node.path for node in NODES]
    assert values(nodes.labels) == ["root", "first", "second", "leaf"]
    idle = colour_code(Status.IDLE)
    expected = [colour_code(Status.RUNNING), colour_code(Status.FAILURE), idle, idle]
    assert values(nodes.colors) == expected


def test_a_tree_is_drawn_again_only_when_a_status_changes() -> None:
    stream = NotedStream()
    graph = TreeGraph(stream, NODES)
    for statuses in (STATUSES, STATUSES, {**STATUSES, "Main/root/first": Status.SUCCESS}):
        graph.show(statuses)
    assert len(stream.of("tree")) == 1 + 2  # the edges, and two states
