"""Numbers, paths and the XML of a tree."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

from tests.uav_bt.groot.groot_world import make_tree
from tests.worlds.trees import leaf
from uav_bt import app
from uav_bt.errors import InputError
from uav_bt.groot.transitions import MAX_UID, TreeNumbering, tree_xml
from uav_bt.tree import MissionTree
from uav_bt.tree.nodes import AlwaysSuccess, Sequence

INNER = f'<BehaviorTree ID="Inner">{leaf("in", "S")}</BehaviorTree>'
OUTER = (
    '<BehaviorTree ID="Outer"><Sequence>'
    '<SubTree ID="Inner"/><SubTree ID="Inner" name="named"/>'
    "</Sequence></BehaviorTree>"
)


def numbered(body: str, *more: str) -> tuple[TreeNumbering, ET.Element]:
    numbering = TreeNumbering(make_tree(body, *more))
    return numbering, ET.fromstring(tree_xml(numbering))  # noqa: S314  # written by this test


def test_instances_are_named_by_the_instances_around_them() -> None:
    """As in BehaviorTree.CPP: by name, or by id and number without a name."""
    body = '<Sequence><SubTree ID="Outer" name="x"/><SubTree ID="Outer"/></Sequence>'
    numbering, root = numbered(body, OUTER, INNER)
    paths = [instance.full_path for instance in numbering.instances]
    assert paths[:4] == ["", "x", "x/Inner::4", "x/named"]
    assert paths[4:] == ["Outer::8", "Outer::8/Inner::10", "Outer::8/named"]
    assert [tree.get("_fullpath") for tree in root.iter("BehaviorTree")] == paths
    assert [tree.get("ID") for tree in root.iter("BehaviorTree")] == [
        *("Main", "Outer", "Inner", "Inner", "Outer", "Inner", "Inner")
    ]
    inside = {node.get("_fullpath") for node in root.iter("SubTree")}
    assert inside == set(paths[1:])


def test_attributes_are_written_as_in_a_tree_file() -> None:
    """Defaults are added; references, conditions and entries of a subtree are kept."""
    body = (
        '<Repeat num_cycles="{n}" _skipIf="a &lt; 1" _onSuccess="b:=&apos;x&apos;">'
        '<Sequence><Sleep msec="20"/>'
        '<SubTree ID="Inner" name="s" in_="{out}" fixed="7" _autoremap="true"/></Sequence></Repeat>'
    )
    _, root = numbered(body, INNER)
    repeat, sub = root.find(".//Repeat"), root.find(".//SubTree")
    sleep = root.find(".//Sleep")
    assert repeat is not None
    assert sub is not None
    assert sleep is not None
    scripts = {"_skipIf": "a < 1", "_onSuccess": "b:='x'"}
    assert dict(repeat.attrib) == {"name": "Repeat", "_uid": "1", "num_cycles": "{n}", **scripts}
    assert sleep.get("msec") == "20"
    names = {"ID": "Inner", "name": "s", "_fullpath": "s", "_uid": "4"}
    assert dict(sub.attrib) == {**names, "in_": "{out}", "fixed": "7", "_autoremap": "true"}


def test_names_that_xml_cannot_hold_are_replaced() -> None:
    tree = MissionTree(Sequence('a\x00<&"b', [AlwaysSuccess("\ud800")]), name="T")
    root = ET.fromstring(tree_xml(TreeNumbering(tree)))  # noqa: S314  # our own
    assert [node.get("name") for node in root.iter() if node.get("_uid")] == [
        'a\ufffd<&"b',
        "\ufffd",
    ]


def test_a_tree_with_too_many_nodes_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    assert MAX_UID == 65_535  # two bytes
    monkeypatch.setattr("uav_bt.groot.transitions.MAX_UID", 3)
    tree = MissionTree(Sequence("all", [AlwaysSuccess() for _ in range(3)]))
    with pytest.raises(InputError, match="has 4 nodes; at most 3"):
        TreeNumbering(tree)


@pytest.mark.parametrize(
    "name", sorted(file.stem for file in (Path(app.__file__).parents[2] / "trees").glob("*.xml"))
)
def test_every_shipped_mission_can_be_written_and_read_back(name: str) -> None:
    tree = app.check(name)
    root = ET.fromstring(tree_xml(TreeNumbering(tree)))  # noqa: S314  # our own
    names = {int(node.attrib["_uid"]): node.attrib["name"] for node in root.iterfind(".//*[@_uid]")}
    assert [names[uid] for uid in sorted(names)] == [node.name for node in tree.nodes()]
