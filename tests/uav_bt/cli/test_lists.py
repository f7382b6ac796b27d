"""`uav-bt nodes` and `uav-bt scenes`: what there is to compose and to fly in."""

from __future__ import annotations

import json
from pathlib import Path
from xml.etree import ElementTree as ET

import cv2

from sim_bridge.twin.scene_file import scene_names
from tests.uav_bt.cli.cli_world import assert_refused, run
from uav_bt.tree import NodeRegistry


def test_nodes_lists_every_node_with_its_attributes_and_keys() -> None:
    result = run("nodes")
    assert result.exit_code == 0
    heads = [line.split()[0] for line in result.stdout.splitlines() if line[:1].isalpha()]
    assert sorted(heads) == sorted(NodeRegistry.installed())
    assert '    policy="segmentation"  str: leaf policy that chooses the way' in result.stdout
    assert "    writes class_map" in result.stdout


def test_nodes_can_be_asked_for_one() -> None:
    result = run("nodes", "Segment")
    assert result.stdout.startswith("Segment  (action, behaviours.perceive.class_map.Segment)\n")
    assert "Explore" not in result.stdout


def test_an_unknown_node_gets_a_suggestion() -> None:
    assert_refused(run("nodes", "Explor"), "unknown node 'Explor'; did you mean 'Explore'")


def test_nodes_as_xml_is_a_model_of_our_nodes() -> None:
    root = ET.fromstring(run("nodes", "--xml").stdout)  # noqa: S314  # our own text
    ids = {node.get("ID") for node in root.find("TreeNodesModel")}
    assert {"Explore", "TakeOff", "Land"} <= ids
    assert "Sequence" not in ids


def test_nodes_as_json_has_an_object_for_each() -> None:
    infos = {info["node_id"]: info for info in json.loads(run("nodes", "--format", "json").stdout)}
    assert set(infos) == set(NodeRegistry.installed())
    (find,) = json.loads(run("nodes", "FindHelipad", "--format", "json").stdout)
    assert find == infos["FindHelipad"]
    assert (find["kind"], find["builtin"], "helipad" in find["writes"]) == ("Action", False, True)
    (msec,) = infos["Timeout"]["ports"]
    assert msec == {
        "name": "msec",
        "type": "int",
        "default": None,
        "doc": "milliseconds; 0: no limit",
        "direction": "input",
        "choices": [],
        "required": True,
    }


def test_nodes_has_one_format_at_a_time() -> None:
    assert run("nodes", "--format", "xml").stdout == run("nodes", "--xml").stdout
    assert_refused(run("nodes", "--xml", "--format", "json"), "exclude each other")


def test_scenes_has_a_line_for_each() -> None:
    result = run("scenes")
    assert result.exit_code == 0
    assert [line.split()[0] for line in result.stdout.splitlines()] == list(scene_names())
    assert "8 boxes, 0.60 to 2.15 m high (5 reach 1.5 m), helipad at (-1.6, 1.2)" in result.stdout


def test_a_scene_is_drawn(tmp_path: Path) -> None:
    out = tmp_path / "map.png"
    result = run("scenes", "--show", "val-b", "--out", out)
    assert result.exit_code == 0
    assert f"map: {out}" in result.stdout
    picture = cv2.imread(str(out))
    assert picture.shape[:2] == (780, 960)
    assert picture.std() > 10.0


def test_scenes_refuses_what_it_cannot_draw(tmp_path: Path) -> None:
    assert_refused(run("scenes", "--show", "val-bb"), "unknown scene 'val-bb'")
    assert_refused(run("scenes", "--out", tmp_path / "map.png"), "--show")
    assert list(tmp_path.iterdir()) == []
