"""Pictures of trees: content, well-formed output, and a layout inside the picture."""

from __future__ import annotations

import re
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

from tests.conformance import Scripted
from tests.worlds.trees import document
from uav_bt.board import STATE
from uav_bt.tree import Leaf, MissionTree, NodeRegistry, Port, load_tree, parse_tree
from uav_bt.tree.describe import FORMATS, Box, ascii_art, render, sketch
from uav_bt.tree.nodes import AlwaysSuccess, Sequence

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
