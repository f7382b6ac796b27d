"""Broken tree files: none crashes, hangs, or loads with an attribute that is not its node's."""

from __future__ import annotations

import random
import re
from pathlib import Path

import pytest
from conformance import REGISTRY, read_traces

from uav_bt.errors import TreeError
from uav_bt.tree import MissionTree, parse_tree
from uav_bt.tree.checker import node_attributes, node_id_of
from uav_bt.tree.conditions import CONDITION_ATTRIBUTES
from uav_bt.tree.source import Element, parse_source

SOURCES = [
    trace["xml"]
    for trace in read_traces(Path(__file__).parents[2] / "data" / "bt_traces_sample.jsonl")
]
PIECE = re.compile(r"<[^>]*>|\w+=\"[^\"]*\"|\w+|[^\w\s]")
WORDS = (
    "Sequence",
    "SubTree",
    "name",
    "script",
    "1",
    "-1",
    "x",
    "{a}",
    "{@a}",
    "{",
    "&lt;",
    "'",
    "",
)


def mutated(random_: random.Random) -> str:
    """Return a tree file with one to three pieces dropped, doubled, swapped or replaced."""
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
    """Load a text, or return None when it is refused in the proper way."""
    try:
        tree = parse_tree(text, REGISTRY)
    except TreeError as error:
        refused = error
    else:
        check_attributes(parse_source(text.encode(), Path("<text>")))
        return tree
    assert refused.findings
    assert all(re.match(r"<text>:\d+:\d+: ", finding) for finding in refused.findings)
    return None


@pytest.mark.parametrize("seed", range(10))
def test_mutated_files_are_refused_or_right(seed: int) -> None:
    """Fifty files a seed; most are refused, with places."""
    random_ = random.Random(seed)  # noqa: S311  # no secret
    loaded = [load(mutated(random_)) for _ in range(50)]
    assert 0 < sum(tree is not None for tree in loaded) < 40
