"""The page of nodes equals the output of `uav-bt tree nodes --format markdown`."""

from __future__ import annotations

from pathlib import Path

import pytest

from behaviours.nodes import NODES
from uav_bt.tree import parse_tree
from uav_bt.tree.describe import describe, example, node_page
from uav_bt.tree.node import Node
from uav_bt.tree.registry import NodeRegistry

REGISTRY = NodeRegistry(NODES)
PAGE = Path(__file__).parents[3] / "docs" / "nodes.md"


def test_the_page_of_the_docs_is_that_of_the_source() -> None:
    assert PAGE.read_text(encoding="utf-8") == node_page(REGISTRY), (
        "run: uav-bt tree nodes --format markdown > docs/nodes.md"
    )


@pytest.mark.parametrize("node", NODES, ids=lambda node: node.node_id)
def test_an_example_loads(node: type[Node]) -> None:
    tree = f'<BehaviorTree ID="T">{example(describe(node))}</BehaviorTree>'
    assert parse_tree(f'<root BTCPP_format="4">{tree}</root>', registry=REGISTRY)


def test_each_port_has_a_row_with_its_default_and_range() -> None:
    page = node_page(REGISTRY)
    assert (
        "| `front_m` | float | `2.0` | front plane from the drone's centre, m (0.05 to 50) |"
        in page
    )
    assert "| `degrees` | float | required |" in page
