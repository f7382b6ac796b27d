"""Observers: what they are notified of, in which order, and beside each other."""

from __future__ import annotations

from tests.uav_bt.tree.tree_world import World, leaf
from uav_bt.tree import Node
from uav_bt.tree.observer import NodeEvent, observe, unobserve

BODY = f"<Sequence>{leaf('a', 'K')}{leaf('b', 'RR')}</Sequence>"


class Notes:
    """Writes down events as `name event`."""

    def __init__(self) -> None:
        self.lines: list[str] = []

    def note(self, node: Node, event: NodeEvent) -> None:
        """Write down an event."""
        self.lines.append(f"{node.name} {event.value}")

    def take(self) -> list[str]:
        lines, self.lines = self.lines, []
        return lines


def test_a_node_notifies_its_observer_of_everything(world: World) -> None:
    """Work, change of status, answer; a halt from the root down and its end from the leaf up."""
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
    """In the order in which they came; the slot is empty when the last has gone."""
    tree = world.tree(leaf("b", "R"))
    first, second = Notes(), Notes()
    for notes in (first, second):
        observe(tree.nodes(), notes.note)
    tree.tick()
    assert first.take() == second.take() == ["b started", "b status", "b continues"]
    unobserve(tree.nodes(), first.note)
    unobserve(tree.nodes(), first.note)  # once more does no harm
    tree.tick()
    assert (first.take(), second.take()) == ([], ["b ran", "b continues"])
    unobserve(tree.nodes(), second.note)
    assert tree.root.observer is None
