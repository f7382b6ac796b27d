"""Observers: their events, the order of events, and several observers."""

from __future__ import annotations

from tests.worlds.trees import World, leaf
from uav_bt.tree import Node
from uav_bt.tree.observer import NodeEvent, observe, unobserve

BODY = f"<Sequence>{leaf('a', 'K')}{leaf('b', 'RR')}</Sequence>"


class Notes:
    """Records events as `name event`."""

    def __init__(self) -> None:
        self.lines: list[str] = []

    def note(self, node: Node, event: NodeEvent) -> None:
        """Record an event."""
        self.lines.append(f"{node.name} {event.value}")

    def take(self) -> list[str]:
        lines, self.lines = self.lines, []
        return lines


def test_a_node_notifies_its_observer_of_everything(world: World) -> None:
    """Start, status, answer; halts begin at the root and end at the leaves first."""
    tree, notes = world.tree(BODY), Notes()
    observe(tree.nodes(), notes.note)
    tree.tick()
    assert notes.take() == [
        *("Sequence started", "Sequence status", "a started", "a skipped"),
        *("b started", "b status", "b continues", "Sequence continues"),
    ]
    tree.tick()
    assert notes.take() == ["Sequence ran", "b ran", "b continues", "Sequence continues"]
    tree.halt()
    assert notes.take() == [
        *("Sequence halting", "b halting", "b status", "b halted"),
        *("Sequence status", "Sequence halted"),
    ]


def test_observers_come_and_go(world: World) -> None:
    """They are called in the order of registration; the slot is empty after the last one."""
    tree = world.tree(leaf("b", "R"))
    first, second = Notes(), Notes()
    for notes in (first, second):
        observe(tree.nodes(), notes.note)
    tree.tick()
    assert first.take() == second.take() == ["b started", "b status", "b continues"]
    unobserve(tree.nodes(), first.note)
    unobserve(tree.nodes(), first.note)  # a second call has no effect
    tree.tick()
    assert (first.take(), second.take()) == ([], ["b ran", "b continues"])
    unobserve(tree.nodes(), second.note)
    assert tree.root.observer is None
