"""Drawings of trees, and the pages that describe nodes."""

from __future__ import annotations

import enum
import re
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from behaviours.nodes import NODES
from tests.conformance import Scripted, read_traces
from tests.worlds.trees import World, document
from uav_bt.board import STATE, Key
from uav_bt.errors import TreeError
from uav_bt.tree import Leaf, MissionTree, Node, NodeRegistry, Port, Status, load_tree, parse_tree
from uav_bt.tree.describe import (
    FORMATS,
    Box,
    ascii_art,
    default_text,
    example,
    in_order,
    render,
    sketch,
    summary,
)
from uav_bt.tree.node_page import node_page
from uav_bt.tree.nodes import BUILTIN_NODES, AlwaysSuccess, Sequence, SubTree
from uav_bt.tree.port import CONDITION_ATTRIBUTES
from uav_bt.types.arrays import Floats

TREES = Path(__file__).parents[3] / "trees"
SVG = "{http://www.w3.org/2000/svg}"


class Measure(Leaf):
    """Measures <something>."""

    ports = (
        Port("speed_mps", float, default=0.5, doc="m/s"),
        Port("title", str, default="", doc="any"),
        Port("height_m", float, default="{@height_above_ground_m}", doc="m"),
        Port("result", float, direction="output", doc="m"),
    )
    reads = (STATE,)
    writes = (STATE,)


REGISTRY = NodeRegistry([Scripted, Measure])


def tree_of(body: str, *more: str) -> MissionTree:
    return parse_tree(document(body, *more), REGISTRY)


def box_of(body: str, *more: str) -> Box:
    return sketch(tree_of(body, *more).root)


# --- text of a box -------------------------------------------------------------------------------


def test_a_box_shows_values_and_references_but_no_empty_or_usual_ones() -> None:
    box = box_of('<Measure name="probe" result="{depth}" _skipIf="a == 1"/>')
    assert (box.tag, box.name, box.path) == ("Measure", "probe", "Main/probe")
    assert box.attributes == ("speed_mps=0.5", "result={depth}", "_skipIf=a == 1")
    assert box.keys == ("reads state", "writes state")
    assert box_of('<Measure height_m="{h}"/>').attributes == ("speed_mps=0.5", "height_m={h}")


# --- formats --------------------------------------------------------------------------------------


def test_ascii_has_a_line_for_each_node() -> None:
    body = (
        '<Sequence name="all"><Inverter><Measure title="x"/></Inverter><AlwaysSuccess/></Sequence>'
    )
    assert ascii_art(sketch(tree_of(body).root), "Main") == (
        "Main\n"
        "`-- Sequence 'all'\n"
        "    |-- Inverter\n"
        "    |   `-- Measure speed_mps=0.5 title=x\n"
        "    `-- AlwaysSuccess\n"
    )


NASTY = 'a"b\\<c>&amp;&quot;]]#;`d'


def nasty_tree() -> MissionTree:
    return MissionTree(Sequence(NASTY, [AlwaysSuccess(), Measure(None, title='"<&')]), name=NASTY)


def test_svg_escapes_all_texts() -> None:
    root = ET.fromstring(render(nasty_tree().root, NASTY, "svg"))  # noqa: S314  # our own text
    title, first, _, measure = ("".join(line.itertext()) for line in root.iter(f"{SVG}text"))
    assert title == NASTY
    assert first.endswith(f"`-- Sequence '{NASTY}'")
    assert 'title="<&' in measure


@pytest.mark.parametrize("format_", FORMATS)
@pytest.mark.parametrize("path", sorted(TREES.glob("*.xml")), ids=lambda path: path.stem)
def test_every_shipped_tree_is_drawn_with_all_its_nodes(path: Path, format_: str) -> None:
    tree = load_tree(path)
    text = render(tree.root, tree.name, format_)
    for tag in {type(node).node_id for node in tree.nodes()}:
        drawn = sum(node.node_id == tag for node in tree.nodes())
        assert len(re.findall(rf"\b{tag}\b", text)) >= drawn


# --- docs/nodes.md --------------------------------------------------------------------------------

LEAVES = NodeRegistry(NODES)
NODES_PAGE = Path(__file__).parents[3] / "docs" / "nodes.md"


def test_the_page_of_the_docs_is_that_of_the_source() -> None:
    assert NODES_PAGE.read_text(encoding="utf-8") == node_page(LEAVES), (
        "run: uav-bt tree nodes --format markdown > docs/nodes.md"
    )


@pytest.mark.parametrize("node", NODES, ids=lambda node: node.node_id)
def test_an_example_loads_and_has_the_outputs(node: type[Node]) -> None:
    outputs = [port.name for port in node.ports if port.direction == "output"]
    assert all(f'{name}="{{{name}}}"' in example(node) for name in outputs)
    tree = f'<BehaviorTree ID="T">{example(node)}</BehaviorTree>'
    assert parse_tree(f'<root BTCPP_format="4">{tree}</root>', registry=LEAVES)


class Side(enum.Enum):
    """Where it stands."""

    LEFT = "left"


@dataclass(frozen=True, kw_only=True)
class Post:
    """A post."""

    x_m: float  # in the map's frame
    # (N, 2) its corners
    corners_m: Floats = field(default_factory=lambda: np.empty((0, 2)))
    side: Side = Side.LEFT

    @property
    def far(self) -> bool:
        """Whether it is far."""
        return self.x_m > 5

    def beside(self, y_m: float) -> Post | None:
        """Return the next one."""


class FindPost(Leaf):
    """Find a post."""

    writes = (Key("post", Post, "the nearest post", "", "FindPost", 0.5),)


class Count(Leaf):
    """Count posts."""

    group = "Posts"


def test_the_page_has_a_group_for_each_node_and_the_fields_of_the_boards_values() -> None:
    page = node_page(NodeRegistry([Count, FindPost, Scripted]))
    links = ["Perceiving: [FindPost](#findpost)", "Others: [Scripted](#scripted)", "Posts: [Count]"]
    assert [line for line in links if f"- {line}" not in page] == []
    assert page.index("- Others") < page.index("- Posts") < page.index("## Posts\n\n### Count\n")
    assert "| `post` | [Post](#post) | the nearest post | FindPost | 0.5 s |" in page
    assert "| `home_m` | float | straight distance to the take-off point; -1: unknown, m |" in page
    fields = (
        "x_m: float  # in the map's frame\n# (N, 2) its corners\ncorners_m: Floats\n"
        "side: Side = Side.LEFT\n\nfar -> bool  # Whether it is far.\n"
        "beside(y_m: float) -> Post | None  # Return the next one."
    )
    assert f"### Post\n\nA post.\n\n```text\n{fields}\n```" in page
    assert '### Side\n\nWhere it stands.\n\n```text\nLEFT = "left"\n```' in page
    assert "Board keys" not in node_page(NodeRegistry([Count]), board=False)


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


# --- docs/tree-format.md: its examples run, and its list agrees with the registry -----------------

ROOT = Path(__file__).parents[3]
PAGE = (ROOT / "docs" / "tree-format.md").read_text(encoding="utf-8")
XML = re.findall(r"```xml\n(.*?)```", PAGE, re.DOTALL)
ALIKE = re.compile(r"Switch\d|Loop(Int|Double|Bool)")  # one line for all of a family


def line(node: type[Node]) -> str:
    """Return the line of a node on the page."""
    written = [node.node_id]
    for port in node.ports:
        default = "" if default_text(port) is None else f"={default_text(port)}"
        written.append(port.name + default + ("" if port.direction == "input" else " (out)"))
    return f"- {' '.join(f'`{each}`' for each in written)}: {summary(node)}"


@pytest.mark.parametrize("node", BUILTIN_NODES, ids=lambda node: node.node_id)
def test_the_page_says_what_a_node_of_the_format_is(node: type[Node]) -> None:
    if node is SubTree:
        assert f": {summary(node)}\n" in PAGE
    elif ALIKE.fullmatch(node.node_id):
        named = "Switch2` to `Switch6" if "Switch" in node.node_id else node.node_id
        assert re.search(rf"^- .*`{named}`", PAGE, re.MULTILINE)
    else:
        kind = PAGE.partition(f"**{node.kind.value}**")[2].partition("\n**")[0]
        assert f"{line(node)}\n" in kind


def test_the_page_says_which_nodes_no_trace_contains() -> None:
    recorded = {name for trace in read_traces() for name in re.findall(r"<(\w+)", trace["xml"])}
    (named,) = re.findall(r"contain all nodes above but (.*?);", PAGE.replace("\n", " "))
    unrecorded = {node.node_id for node in BUILTIN_NODES} - recorded
    assert set(re.findall(r"`(\w+)`", named)) == unrecorded


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
