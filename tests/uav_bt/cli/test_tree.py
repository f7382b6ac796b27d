"""`uav-bt check`, `new` and `tree ...`: the tools around tree files."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

from tests.uav_bt.cli.cli_world import HOP, assert_refused, run, tree_file
from uav_bt.tree import NodeRegistry
from uav_bt.tree.loading.schema import schema_xml

SHIPPED = Path(__file__).parents[3] / "trees"


@pytest.mark.parametrize("path", sorted(SHIPPED.glob("*.xml")), ids=lambda path: path.stem)
def test_shipped_missions_are_good_by_file_and_by_name(path: Path) -> None:
    by_file, by_name = run("check", path), run("check", path.stem)
    assert (by_file.exit_code, by_name.exit_code) == (0, 0), by_file.output + by_name.output
    assert by_file.stdout == f"{path}: good\n"


def test_all_findings_of_all_files_are_told_with_their_lines(tmp_path: Path) -> None:
    good = tree_file(tmp_path, HOP, "good.xml")
    bad = tree_file(tmp_path, '<Sequence>\n<TakOff/>\n<Land hight="1"/>\n</Sequence>', "bad.xml")
    worse = tree_file(tmp_path, "<Sequence>", "worse.xml")
    result = run("check", bad, good, worse)
    assert result.exit_code == 2
    assert result.stdout == f"{good}: good\n"
    lines = result.stderr.splitlines()
    assert len(lines) == 3
    assert lines[0].startswith(f"{bad}:4:")
    assert "did you mean 'TakeOff'" in lines[0]
    assert lines[1].startswith(f"{bad}:5:")
    assert "hight" in lines[1]
    assert lines[2].startswith(f"{worse}:")


def test_a_policy_that_nobody_registered_is_a_finding_with_its_line(tmp_path: Path) -> None:
    body = (
        "<Sequence>\n"
        '<Explore policy="segmentation"/>\n'
        '<Explore policy="segmentatio"/>\n'
        '<Avoid policy="depht"/>\n'
        "</Sequence>"
    )
    path = tree_file(tmp_path, body)
    result = run("check", path)
    assert_refused(result)
    first, second = result.stderr.splitlines()
    assert first.startswith(f"{path}:5:")
    assert "'segmentatio'; did you mean 'segmentation'" in first
    assert second.startswith(f"{path}:6:")
    assert "unknown policy 'depht'" in second


def test_a_policy_that_a_variable_names_is_left_to_the_flight(tmp_path: Path) -> None:
    assert run("check", tree_file(tmp_path, '<Explore policy="{way}"/>')).exit_code == 0


def test_an_absent_file_is_told_and_the_others_are_checked(tmp_path: Path) -> None:
    good = tree_file(tmp_path, HOP)
    result = run("check", tmp_path / "absent.xml", good)
    assert result.exit_code == 2
    assert "absent.xml: no such tree file" in result.stderr
    assert result.stdout == f"{good}: good\n"


def test_a_folder_is_no_tree_file(tmp_path: Path) -> None:
    assert_refused(run("check", tmp_path), str(tmp_path))


def test_nothing_to_check_is_wrong_usage() -> None:
    assert_refused(run("check"), "TREE")


# --- folders, palettes, JSON ----------------------------------------------------------------------


def test_a_folder_stands_for_all_tree_files_in_it(tmp_path: Path) -> None:
    (tmp_path / "more").mkdir()
    (tmp_path / ".hidden").mkdir()
    first = tree_file(tmp_path, HOP, "a.xml")
    second = tree_file(tmp_path / "more", HOP, "b.xml")
    tree_file(tmp_path / ".hidden", "<Unknown/>")
    (tmp_path / "notes.txt").write_text("no tree", encoding="utf-8")
    result = run("check", tmp_path)
    assert (result.exit_code, result.stdout) == (0, f"{first}: good\n{second}: good\n")


def test_a_foreign_tree_is_checked_with_its_palette(tmp_path: Path) -> None:
    palette = tmp_path / "palette.txt"
    palette.write_text(
        '<root BTCPP_format="4"><TreeNodesModel><Action ID="DockRobot"><input_port name="dock" '
        'type="int"/><input_port name="policy" type="std::string"/></Action></TreeNodesModel>'
        "</root>",
        encoding="utf-8",
    )
    good = tree_file(tmp_path, '<DockRobot dock="1" policy="of their own"/>', "good.xml")
    bad = tree_file(tmp_path, '<DockRobot dock="one"/>', "bad.xml")
    result = run("check", good, bad, "--palette", palette)
    assert (result.exit_code, result.stdout) == (2, f"{good}: good\n")
    assert "expected an integer, got 'one'" in result.stderr
    assert "unknown node 'DockRobot'" in run("check", good).stderr
    assert_refused(run("check", good, "--palette", bad), "expected a <TreeNodesModel>")
    assert_refused(run("check", good, "--palette", tmp_path / "absent.xml"), "no such file")


def test_json_has_one_object_a_line_and_file(tmp_path: Path) -> None:
    good = tree_file(tmp_path, HOP, "good.xml")
    bad = tree_file(tmp_path, '<Sequence>\n<Land\n  hight="1"/>\n</Sequence>', "bad.xml")
    result = run("check", good, bad, tmp_path / "absent.xml", "--format", "json")
    assert (result.exit_code, result.stderr) == (2, "")
    first, second, third = (json.loads(line) for line in result.stdout.splitlines())
    assert first == {"file": str(good), "ok": True, "findings": []}
    assert (second["file"], second["ok"]) == (str(bad), False)
    (finding,) = second["findings"]
    assert finding.pop("message").startswith("unknown attribute 'hight'")
    assert finding == {"path": str(bad), "line": 5, "column": 3, "node": "Land"}
    (finding,) = third["findings"]
    assert finding.pop("message").startswith("no such tree file")
    assert finding == {
        "path": str(tmp_path / "absent.xml"),
        "line": None,
        "column": None,
        "node": "",
    }


def test_json_tells_where_the_xml_breaks(tmp_path: Path) -> None:
    broken = tree_file(tmp_path, "<Sequence>")
    (line,) = run("check", broken, "--format", "json").stdout.splitlines()
    (finding,) = json.loads(line)["findings"]
    assert (finding["line"], finding["message"][:19]) == (4, "not well-formed XML")


# --- nodes ----------------------------------------------------------------------------------------


def test_nodes_lists_every_node_with_its_attributes_and_keys() -> None:
    result = run("tree", "nodes")
    assert result.exit_code == 0
    heads = [line.split()[0] for line in result.stdout.splitlines() if line[:1].isalpha()]
    assert sorted(heads) == sorted(NodeRegistry.installed())
    assert '    policy="segmentation"  str: leaf policy that chooses the way' in result.stdout
    assert "    writes class_map" in result.stdout


def test_nodes_can_be_asked_for_one() -> None:
    result = run("tree", "nodes", "Segment")
    assert result.stdout.startswith("Segment  (action, behaviours.perceive.class_map.Segment)\n")
    assert "Explore" not in result.stdout


def test_an_unknown_node_gets_a_suggestion() -> None:
    assert_refused(run("tree", "nodes", "Explor"), "unknown node 'Explor'; did you mean 'Explore'")


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
    (find,) = json.loads(run("tree", "nodes", "FindHelipad", "--format", "json").stdout)
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


# --- schema ---------------------------------------------------------------------------------------


def test_the_schema_of_all_installed_nodes_is_printed_or_written(tmp_path: Path) -> None:
    expected = schema_xml(NodeRegistry.installed())
    assert run("tree", "schema").stdout == expected
    out = tmp_path / "uav-bt.xsd"
    result = run("tree", "schema", "--out", out)
    assert (result.exit_code, result.stdout) == (0, f"written: {out}\n")
    assert out.read_text(encoding="utf-8") == expected


def test_the_schema_knows_the_nodes_of_a_palette(tmp_path: Path) -> None:
    palette = tmp_path / "palette.xml"
    palette.write_text('<TreeNodesModel><Action ID="Dock"/></TreeNodesModel>', encoding="utf-8")
    assert 'name="node.Dock"' in run("tree", "schema", "--palette", palette).stdout


def test_a_schema_that_cannot_be_written_is_refused(tmp_path: Path) -> None:
    assert_refused(run("tree", "schema", "--out", tmp_path / "absent" / "x.xsd"), "absent")


# --- render ---------------------------------------------------------------------------------------


def test_a_tree_is_drawn_in_ascii_unless_told_otherwise() -> None:
    result = run("tree", "render", "land_only")
    assert result.exit_code == 0
    assert result.stdout.startswith("Mission\n`-- ReactiveSequence 'mission'\n    |-- Segment")
    for format_, first in (("svg", "<?xml"), ("ascii", "Mission")):
        assert run("tree", "render", "land_only", "--format", format_).stdout.startswith(first)


def test_a_picture_is_written(tmp_path: Path) -> None:
    out = tmp_path / "tree.svg"
    result = run("tree", "render", "land_only", "--format", "svg", "--out", out)
    assert result.stdout == f"written: {out}\n"
    assert out.read_text(encoding="utf-8").endswith("</svg>\n")


def test_a_foreign_tree_is_drawn_with_its_palette(tmp_path: Path) -> None:
    palette = tmp_path / "palette.xml"
    palette.write_text('<TreeNodesModel><Action ID="Dock"/></TreeNodesModel>', encoding="utf-8")
    path = tree_file(tmp_path, "<Dock/>")
    assert run("tree", "render", path, "--palette", palette).stdout == "Main\n`-- Dock\n"
    assert_refused(run("tree", "render", path), "unknown node 'Dock'", "mission.xml:3:1")


def test_a_tree_that_is_not_there_is_not_drawn(tmp_path: Path) -> None:
    assert_refused(run("tree", "render", tmp_path / "absent.xml"), "no such tree file")


# --- new ------------------------------------------------------------------------------------------


def test_a_new_mission_is_written_once_and_is_good(tmp_path: Path) -> None:
    path = tmp_path / "mine.xml"
    result = run("new", path, "--from", "land")
    assert (result.exit_code, result.stdout[: len(f"written: {path}")]) == (0, f"written: {path}")
    assert run("check", path).stdout == f"{path}: good\n"
    assert_refused(run("new", path), "not overwritten")
    assert_refused(run("new", tmp_path / "other.xml", "--from", "lan"), "--from")


# --- all of them ----------------------------------------------------------------------------------


def test_the_tools_need_nothing_that_flies_or_draws_pictures(tmp_path: Path) -> None:
    """They start at once, and run where no simulator and no network runtime is installed."""
    (tmp_path / "script.yaml").write_text("default: S", encoding="utf-8")
    heavy = ("mujoco", "openvino", "torch", "cv2", "av", "rich", "sklearn", "zmq", "scipy")
    calls = [
        ["new", "mine.xml"],
        ["check", "mine.xml", "--format", "json"],
        ["tree", "nodes", "--format", "json"],
        ["tree", "schema"],
        ["tree", "render", "mine.xml", "--format", "svg"],
        ["simulate", "mine.xml", "--script", "script.yaml"],
    ]
    code = (
        f"import sys\nfor name in {heavy}: sys.modules[name] = None\n"
        "from click.testing import CliRunner\nfrom uav_bt.cli.root import uav_bt\n"
        f"for call in {calls}:\n"
        "    result = CliRunner().invoke(uav_bt, call)\n"
        "    assert result.exit_code == 0, (call, result.output)\n"
    )
    done = subprocess.run(  # noqa: S603  # our own interpreter and code
        [sys.executable, "-c", code], capture_output=True, text=True, cwd=tmp_path, check=False
    )
    assert done.returncode == 0, done.stderr
