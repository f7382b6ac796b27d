"""The tree as a graph: where its nodes stand, and which colours they have."""

from __future__ import annotations

from tests.uav_bt.display.rerun.rerun_world import NODES, NotedStream, values
from uav_bt.display.rerun.tree_graph import STATUS_COLOURS, TreeGraph, places
from uav_bt.tree import Status

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
