"""Descriptions: lists for people, a palette for editors."""

from __future__ import annotations

from pathlib import Path

from tests.conformance import Scripted
from tests.worlds.trees import document
from uav_bt.board import HEIGHT, STATE
from uav_bt.tree import Leaf, NodeRegistry, Port, Status, parse_tree
from uav_bt.tree.describe import describe_all, palette_xml
from uav_bt.tree.loading.loader import check_text


class Pretty(Leaf):
    """Draw <something> & stop.

    Nobody reads further than that.
    """

    ports = (
        Port("side", str, doc="left & right", choices=("left", "right")),
        Port("fast", bool, default=True),
        Port("size", float, default="{@height_above_ground_m}", doc="size, m", least=0.1, most=5),
        Port("count", int, direction="output", doc="how many"),
    )
    reads = (HEIGHT,)
    writes = (STATE,)
    condition = True

    def update(self) -> Status:
        return Status.SUCCESS


REGISTRY = NodeRegistry([Scripted, Pretty])


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


def test_the_palette_is_a_model_that_the_loader_accepts() -> None:
    palette = palette_xml(REGISTRY)
    assert (
        'type="double" default="{@height_above_ground_m}">size, m (0.1 to 5)</input_port>'
        in palette
    )
    assert "left &amp; right" in palette
    model = palette.split("\n", 1)[1].rsplit("</root>", 1)[0]
    parse_tree(document("<AlwaysSuccess/>", model), REGISTRY)
    other = document("<AlwaysSuccess/>", model.replace('ID="Pretty"', 'ID="Scripted"', 1))
    found = check_text(other, NodeRegistry([Scripted]), path=Path("m.xml"))
    assert any("no port 'count'" in finding.message for finding in found)
