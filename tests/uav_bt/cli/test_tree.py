"""`uav-bt tree`: nodes listed, trees drawn, schemas written."""

from __future__ import annotations

import json
from pathlib import Path
from xml.etree import ElementTree as ET

from tests.worlds.cli import assert_refused, run, tree_file
from uav_bt.tree import NodeRegistry
from uav_bt.tree.loading.schema import schema_xml


def test_nodes_lists_every_node_with_its_attributes_and_keys() -> None:
    result = run("tree", "nodes")
    assert result.exit_code == 0
    assert set(NodeRegistry.installed()) <= set(result.stdout.split())
    one = run("tree", "nodes", "Segment").stdout
    assert one.split()[:5] == ["Segment", "Segment", "each", "new", "frame"]
    assert " model    str   unet     'unet', 'any' (any room, by roles)" in one
    assert "Writes class_map" in one
    page = run("tree", "nodes", "Turn", "--format", "markdown").stdout
    assert (page[:7], "## Turn" in page) == ("# Nodes", True)
    assert "Explore" not in one + page


def test_nodes_as_xml_is_a_model_of_our_nodes() -> None:
    root = ET.fromstring(run("tree", "nodes", "--format", "xml").stdout)  # noqa: S314  # our own text
    ids = {node.get("ID") for node in root.find("TreeNodesModel")}
    assert {"Explore", "TakeOff", "Land"} <= ids
    assert "Sequence" not in ids


def test_nodes_as_json_has_an_object_for_each() -> None:
    infos = {
        info["node_id"]: info
        for info in json.loads(run("tree", "nodes", "--format", "json").stdout)
    }
    assert set(infos) == set(NodeRegistry.installed())
    (find,) = json.loads(run("tree", "nodes", "FindMark", "--format", "json").stdout)
    assert find == infos["FindMark"]
    assert (find["kind"], find["builtin"], "mark" in find["writes"]) == ("Action", False, True)
    (msec,) = infos["Timeout"]["ports"]
    assert msec == {
        "name": "msec",
        "type": "int",
        "default": None,
        "doc": "milliseconds; 0: no limit",
        "direction": "input",
        "sample": "",
        "choices": [],
        "least": 0,
        "most": None,
        "range": "0 or more",
        "required": True,
    }


def test_the_schema_of_all_installed_nodes_is_printed_or_written(tmp_path: Path) -> None:
    expected = schema_xml(NodeRegistry.installed())
    assert run("tree", "schema").stdout == expected
    out = tmp_path / "uav-bt.xsd"
    result = run("tree", "schema", "--out", out)
    assert (result.exit_code, result.stdout) == (0, f"written: {out}\n")
    assert out.read_text(encoding="utf-8") == expected


def test_a_tree_is_drawn_in_ascii_by_default(tmp_path: Path) -> None:
    result = run("tree", "render", "land_only")
    assert result.exit_code == 0
    assert result.stdout.startswith("Mission\n`-- ReactiveSequence 'mission'\n    |-- Segment")
    assert run("tree", "render", "land_only", "--format", "ascii").stdout == result.stdout
    out = tmp_path / "tree.svg"
    drawn = run("tree", "render", "land_only", "--format", "svg", "--out", out)
    assert drawn.stdout == f"written: {out}\n"
    assert out.read_text(encoding="utf-8").startswith("<?xml")


def test_a_foreign_tree_is_drawn_with_its_palette(tmp_path: Path) -> None:
    palette = tmp_path / "palette.xml"
    palette.write_text('<TreeNodesModel><Action ID="Dock"/></TreeNodesModel>', encoding="utf-8")
    path = tree_file(tmp_path, "<Dock/>")
    assert run("tree", "render", path, "--palette", palette).stdout == "Main\n`-- Dock\n"
    assert 'name="node.Dock"' in run("tree", "schema", "--palette", palette).stdout
    assert_refused(run("tree", "render", path), "unknown node 'Dock'", "mission.xml:3:1")
