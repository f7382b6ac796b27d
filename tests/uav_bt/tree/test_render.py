"""Pictures of trees: content, well-formed output, and a layout without overlaps."""

from __future__ import annotations

import itertools
import re
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

from tests.conformance import Scripted
from tests.worlds.trees import document
from uav_bt.board import STATE
from uav_bt.tree import Leaf, MissionTree, NodeRegistry, Port, Status, load_tree, parse_tree
from uav_bt.tree.loading.palette import PaletteLeaf, PalettePort
from uav_bt.tree.nodes import AlwaysSuccess, Inverter, Sequence
from uav_bt.tree.render import FORMATS, render
from uav_bt.tree.render.sketch import Box, sketch
from uav_bt.tree.render.svg import Size, arrange

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

    def update(self) -> Status:
        return Status.SUCCESS


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


def test_a_subtree_is_shown_with_its_entries_and_what_is_in_it() -> None:
    other = '<BehaviorTree ID="Other"><AlwaysSuccess/></BehaviorTree>'
    box = box_of('<SubTree ID="Other" speed="{v}" _autoremap="true"/>', other)
    assert (box.tag, box.name) == ("SubTree Other", "")
    assert set(box.attributes) == {"speed={v}", "_autoremap=true"}
    assert [child.tag for child in box.children] == ["AlwaysSuccess"]
    assert box_of('<SubTree ID="Other" name="here"/>', other).name == "here"


def test_long_texts_and_control_characters_are_cut() -> None:
    box = sketch(AlwaysSuccess("a\nb\x00c" + 50 * "x"))
    assert box.name == "a b c" + 28 * "x" + "..."


def test_a_port_of_a_palette_that_nobody_gave_is_left_out() -> None:
    class Foreign(PaletteLeaf):
        ports = (PalettePort("goal", str), PalettePort("hz", float))

    assert sketch(Foreign(None, hz=2.0)).attributes == ("hz=2",)


def test_a_tree_of_any_depth_is_drawn() -> None:
    """A tree composed in Python may have any depth, and can still be drawn."""
    node = AlwaysSuccess()
    for _ in range(1500):
        node = Inverter(None, node)
    for draw in FORMATS.values():
        assert draw(sketch(node), "deep").count("AlwaysSuccess") >= 1


# --- formats --------------------------------------------------------------------------------------


def test_ascii_has_a_line_for_each_node() -> None:
    body = (
        '<Sequence name="all"><Inverter><Measure title="x"/></Inverter><AlwaysSuccess/></Sequence>'
    )
    assert render(tree_of(body), "ascii") == (
        "Main\n"
        "`-- Sequence 'all'\n"
        "    |-- Inverter\n"
        "    |   `-- Measure speed_mps=0.5 title=x\n"
        "    `-- AlwaysSuccess\n"
    )


def test_ascii_writes_other_letters_as_codes() -> None:
    assert "'\\xfcber'" in render(tree_of('<AlwaysSuccess name="über"/>'), "ascii")


NASTY = 'a"b\\<c>&amp;&quot;]]#;`d'


def nasty_tree() -> MissionTree:
    return MissionTree(Sequence(NASTY, [AlwaysSuccess(), Measure(None, title='"<&')]), name=NASTY)


def test_svg_escapes_all_texts() -> None:
    root = ET.fromstring(render(nasty_tree(), "svg"))  # noqa: S314  # our own text
    texts = [element.text for element in root.iter(f"{SVG}text")]
    assert texts[:3] == [NASTY, "Sequence", NASTY]
    assert 'title="<&' in texts
    assert next(root.iter(f"{SVG}title")).text == NASTY


@pytest.mark.parametrize("format_", FORMATS)
@pytest.mark.parametrize("path", sorted(TREES.glob("*.xml")), ids=lambda path: path.stem)
def test_every_shipped_tree_is_drawn_with_all_its_nodes(path: Path, format_: str) -> None:
    tree = load_tree(path)
    text = render(tree, format_)
    for tag in {type(node).node_id for node in tree.nodes()}:
        drawn = sum(node.node_id == tag for node in tree.nodes())
        assert len(re.findall(rf"\b{tag}\b", text)) >= drawn


# --- the layout -----------------------------------------------------------------------------------


def overlap(root: Box, sizes: dict[int, Size]) -> bool:
    places = arrange(root, sizes).values()
    return any(
        a.left_px < b.left_px + b.width_px
        and b.left_px < a.left_px + a.width_px
        and a.top_px < b.top_px + b.height_px
        and b.top_px < a.top_px + a.height_px
        for a, b in itertools.combinations(places, 2)
    )


BODIES = [
    "<AlwaysSuccess/>",
    f"<Sequence>{9 * '<AlwaysSuccess/>'}</Sequence>",
    "<Sequence><Inverter><Sequence>" + 5 * "<AlwaysSuccess/>" + "</Sequence></Inverter>"
    "<AlwaysSuccess/><Sequence><Inverter><Sequence>" + 4 * "<AlwaysSuccess/>" + "</Sequence>"
    "</Inverter></Sequence></Sequence>",
]


@pytest.mark.parametrize("body", BODIES, ids=["one", "wide", "nested"])
def test_boxes_never_overlap_and_stand_below_their_parents(body: str) -> None:
    root = box_of(body)
    boxes = list(root.walk())
    sizes = {
        id(box): Size(width_px=20.0 + 37.0 * (number % 5), height_px=10.0 + 9.0 * (number % 3))
        for number, box in enumerate(boxes)
    }
    assert not overlap(root, sizes)
    places = arrange(root, sizes)
    assert min(place.left_px for place in places.values()) == pytest.approx(0.0)
    for box in boxes:
        here = places[id(box)]
        below = [places[id(child)] for child in box.children]
        assert all(place.top_px > here.top_px + here.height_px for place in below)
        assert below == sorted(below, key=lambda place: place.left_px)
        if below:
            middle = (below[0].middle_px + below[-1].middle_px) / 2.0
            assert here.middle_px == pytest.approx(middle)


def test_every_text_lies_inside_the_picture() -> None:
    root = ET.fromstring(render(load_tree(TREES / "land_only.xml"), "svg"))  # noqa: S314
    width, height = float(root.get("width")), float(root.get("height"))
    for rect in list(root.iter(f"{SVG}rect"))[1:]:
        assert float(rect.get("x")) >= 0.0
        assert float(rect.get("x")) + float(rect.get("width")) <= width - 30.0
        assert float(rect.get("y")) + float(rect.get("height")) <= height - 30.0


def test_a_notebook_shows_the_drawing_and_a_prompt_says_what_it_is() -> None:
    tree = load_tree(TREES / "land_only.xml")
    assert tree._repr_svg_() == render(tree, "svg")
    count = sum(1 for _ in tree.nodes())
    assert repr(tree) == f"<MissionTree '{tree.name}': {count} nodes, {TREES / 'land_only.xml'}>"
    composed = MissionTree(Sequence("s", [AlwaysSuccess()]), name="Hop")
    assert repr(composed) == "<MissionTree 'Hop': 2 nodes, Hop (composed in Python)>"
