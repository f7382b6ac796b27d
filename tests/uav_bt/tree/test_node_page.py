"""The page of nodes equals the output of `uav-bt tree nodes --format markdown`."""

from __future__ import annotations

from pathlib import Path

import pytest

from behaviours.nodes import NODES
from uav_bt.tree import parse_tree
from uav_bt.tree.describe import example, in_order, node_page, summary
from uav_bt.tree.node import Node
from uav_bt.tree.nodes import BUILTIN_NODES
from uav_bt.tree.registry import NodeRegistry

REGISTRY = NodeRegistry(NODES)
PAGE = Path(__file__).parents[3] / "docs" / "nodes.md"


def test_the_page_of_the_docs_is_that_of_the_source() -> None:
    assert PAGE.read_text(encoding="utf-8") == node_page(REGISTRY), (
        "run: uav-bt tree nodes --format markdown > docs/nodes.md"
    )


@pytest.mark.parametrize("node", NODES, ids=lambda node: node.node_id)
def test_an_example_loads(node: type[Node]) -> None:
    tree = f'<BehaviorTree ID="T">{example(node)}</BehaviorTree>'
    assert parse_tree(f'<root BTCPP_format="4">{tree}</root>', registry=REGISTRY)


def test_every_number_of_a_shipped_leaf_has_a_range() -> None:
    numbers = [
        (node.node_id, port.name, port.least, port.most)
        for node in in_order(NodeRegistry.installed())
        if node not in BUILTIN_NODES
        for port in node.ports
        if port.type in (int, float) and port.direction == "input"
    ]
    assert len(numbers) > 20
    assert [number for number in numbers if None in number] == []


def test_every_node_of_the_format_describes_itself() -> None:
    for node in BUILTIN_NODES:
        assert summary(node).endswith("."), node.node_id
        assert all(port.doc for port in node.ports), node.node_id
