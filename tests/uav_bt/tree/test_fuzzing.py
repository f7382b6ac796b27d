"""Mutated tree files: none crashes the loader or the engine."""

from __future__ import annotations

import random
import re
from pathlib import Path

import pytest

from tests.conformance import REGISTRY, read_traces
from tests.worlds.trees import World
from uav_bt.board import MISSION_KEYS
from uav_bt.errors import NodeFailedError, TreeError
from uav_bt.tree import MissionTree, parse_tree
from uav_bt.tree.loading.elements import node_attributes, node_id_of
from uav_bt.tree.loading.source import Element, parse_source
from uav_bt.tree.port import CONDITION_ATTRIBUTES

ROOT = Path(__file__).parents[3]
SOURCES = [
    *(trace["xml"] for trace in read_traces()),
    *re.findall(
        r"```xml\n(.*?)```",
        "".join(
            (ROOT / "docs" / f"{name}.md").read_text("utf-8")
            for name in ("tree-format", "missions-in-depth")
        ),
        re.DOTALL,
    )
    * 20,  # has typed ports, remapped subtrees and board keys, so it is used more often
]
PIECE = re.compile(r"<[^>]*>|\w+=\"[^\"]*\"|\w+|[^\w\s]")
WORDS = (
    *("Sequence", "SubTree", "name", "script", "1", "-1", "x", "1.5", "true", "high"),
    *("{a}", "{@a}", "{@mark}", "{", "&lt;", "'", ""),
)


def mutated(random_: random.Random) -> str:
    """Return a tree file with one to three parts removed, doubled, renamed, retyped or cut."""
    text = random_.choice(SOURCES)
    for _ in range(random_.randint(1, 3)):
        piece = random_.choice(list(PIECE.finditer(text)))
        other = random_.choice(list(PIECE.finditer(text)))[0]
        new = random_.choice(["", piece[0] * 2, other, random_.choice(WORDS), piece[0][1:]])
        text = text[: piece.start()] + new + text[piece.end() :]
    return text


def check_attributes(element: Element) -> None:
    """Fail when an element has an attribute that its node does not declare."""
    for child in element.children:
        check_attributes(child)
    if node_id_of(element) in REGISTRY and element.tag != "SubTree":
        known = {port.name for port in REGISTRY[node_id_of(element)].ports} | CONDITION_ATTRIBUTES
        assert set(node_attributes(element)) <= known


def load(text: str) -> MissionTree | None:
    """Load a text, or return None if it is refused with a TreeError."""
    try:
        tree = parse_tree(text, REGISTRY)
    except TreeError as error:
        refused = error
    else:
        check_attributes(parse_source(text.encode(), Path("<text>")))
        return tree
    assert refused.findings
    # An example of the page uses a shipped tree, whose leaves are not in this registry.
    place = r"(<text>|\S+/trees/lib/\w+\.xml):\d+:\d+: "
    assert all(re.match(place, finding) for finding in refused.findings)
    return None


def check_values(tree: MissionTree) -> None:
    """Fail when a port has a value that is not of its type."""
    for node in tree.nodes():
        for port in node.ports:
            if port.name in node.literals:
                assert isinstance(node.literals[port.name], port.type), (node.path, port.name)


def fly(tree: MissionTree, world: World) -> None:
    """Tick a tree three times; only our exceptions are allowed."""
    tree.setup(world.context)
    for name in ("a", "b", "c", "mode"):
        tree.variables[name] = 1
    try:
        for _ in range(3):
            tree.tick()
    except NodeFailedError as error:
        assert error.node_path.startswith(tree.name)  # noqa: PT017  # either way is fine
    tree.halt()


@pytest.mark.parametrize("seed", range(20))
def test_mutated_files_are_refused_or_right(world: World, seed: int) -> None:
    """500 files per seed, 10,000 in total; most are refused, with positions.

    Loaded trees have the attributes and types that their nodes declare, and can be ticked.
    """
    random_ = random.Random(seed)  # noqa: S311  # no secret
    for key in MISSION_KEYS:
        world.board.declare(key)
    loaded = 0
    for _ in range(500):
        tree = load(mutated(random_))
        if tree is not None:
            loaded += 1
            check_values(tree)
            fly(tree, world)
    assert 0 < loaded < 400
