"""Descriptions: lists for people, a palette for editors."""

from __future__ import annotations

from uav_bt.tree import NodeRegistry
from uav_bt.tree.describe import describe_all


def test_every_number_of_a_shipped_leaf_has_a_range() -> None:
    infos = [info for info in describe_all(NodeRegistry.installed()) if not info.builtin]
    numbers = [
        (info.node_id, port.name, port.least, port.most)
        for info in infos
        for port in info.ports
        if port.type in ("int", "float") and port.direction == "input"
    ]
    assert len(numbers) > 20
    assert [number for number in numbers if None in number] == []


def test_every_node_of_the_format_describes_itself() -> None:
    infos = describe_all(NodeRegistry())
    assert {info.kind for info in infos} >= {"Action", "Control", "Decorator", "SubTree"}
    for info in infos:
        assert info.builtin
        assert info.doc.endswith("."), info.node_id
        assert all(port.doc for port in info.ports), info.node_id
