"""`docs/tree-files.md`: its examples run, and its table agrees with the registry."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.conformance import read_traces
from tests.worlds.trees import World
from uav_bt.errors import TreeError
from uav_bt.tree import Node, NodeRegistry, Status, parse_tree
from uav_bt.tree.describe import default_text, summary
from uav_bt.tree.nodes import BUILTIN_NODES
from uav_bt.tree.port import CONDITION_ATTRIBUTES

ROOT = Path(__file__).parents[3]
PAGE = (ROOT / "docs" / "tree-files.md").read_text(encoding="utf-8")
XML = re.findall(r"```xml\n(.*?)```", PAGE, re.DOTALL)
ROWS = {
    cells[0].strip("`"): cells
    for line in PAGE.splitlines()
    if len(cells := [cell.strip() for cell in line.strip("|").split("|")]) == 5
    and re.fullmatch(r"`\w+`", cells[0])
}


def test_the_table_has_every_node_of_the_format() -> None:
    assert set(ROWS) == {node.node_id for node in BUILTIN_NODES}


@pytest.mark.parametrize("node", BUILTIN_NODES, ids=lambda node: node.node_id)
def test_a_row_says_what_the_node_is(node: type[Node]) -> None:
    _, kind, ports, doc, _ = ROWS[node.node_id]
    assert (kind, doc) == (node.kind.value, summary(node))
    if node.node_id.startswith("Switch"):
        assert ports == f"`variable`, `case_1` to `case_{len(node.ports) - 1}`"
    elif node.node_id != "SubTree":
        written = [
            port.name
            + ("" if default_text(port) is None else f"={default_text(port)}")
            + ("" if port.direction == "input" else " (out)")
            for port in node.ports
        ]
        assert ports == ", ".join(f"`{port}`" for port in written)


def test_proven_is_what_the_traces_contain() -> None:
    recorded: set[str] = set()
    for trace in read_traces():
        recorded |= set(re.findall(r"<(\w+)", trace["xml"]))
    for node_id, cells in ROWS.items():
        assert cells[4] == ("traces" if node_id in recorded else "documentation"), node_id


def test_all_conditions_are_listed() -> None:
    assert all(f"`{name}`" in PAGE for name in CONDITION_ATTRIBUTES)


def test_the_first_example_flies(world: World) -> None:
    tree = parse_tree(XML[0], NodeRegistry())
    tree.setup(world.context)
    answers = []
    for _ in range(8):
        answers.append(tree.tick())
        if answers[-1] is not Status.RUNNING:
            break
        world.clock.advance(0.5)
    assert answers[-1] is Status.SUCCESS
    assert tree.variables["rounds"] == 2


def test_a_misspelt_entry_is_refused_as_the_page_says() -> None:
    with pytest.raises(TreeError) as error:
        parse_tree(XML[0].replace(' count="', ' cuont="'), NodeRegistry(), path="mission.xml")
    message = (
        "SubTree 'Round': entry 'cuont' is used by no node of tree 'Round'; did you mean 'count'?"
    )
    assert message in " ".join(PAGE.split())
    assert any(message in finding for finding in error.value.findings)
