"""`uav-bt schema`, `render` and `new`: the tools around tree files."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from tests.uav_bt.cli.cli_world import assert_refused, run, tree_file
from uav_bt.cli.new import new
from uav_bt.tree import NodeRegistry
from uav_bt.tree.loading.schema import schema_xml
from uav_bt.tree.starter import STARTERS

# --- schema ---------------------------------------------------------------------------------------


def test_the_schema_of_all_installed_nodes_is_printed_or_written(tmp_path: Path) -> None:
    expected = schema_xml(NodeRegistry.installed())
    assert run("schema").stdout == expected
    out = tmp_path / "uav-bt.xsd"
    result = run("schema", "--out", out)
    assert (result.exit_code, result.stdout) == (0, f"written: {out}\n")
    assert out.read_text(encoding="utf-8") == expected


def test_the_schema_knows_the_nodes_of_a_palette(tmp_path: Path) -> None:
    palette = tmp_path / "palette.xml"
    palette.write_text('<TreeNodesModel><Action ID="Dock"/></TreeNodesModel>', encoding="utf-8")
    assert 'name="node.Dock"' in run("schema", "--palette", palette).stdout


def test_a_schema_that_cannot_be_written_is_refused(tmp_path: Path) -> None:
    assert_refused(run("schema", "--out", tmp_path / "absent" / "x.xsd"), "absent")


# --- render ---------------------------------------------------------------------------------------


def test_a_tree_is_drawn_in_ascii_unless_told_otherwise() -> None:
    result = run("render", "land_only")
    assert result.exit_code == 0
    assert result.stdout.startswith("Mission\n`-- ReactiveSequence 'mission'\n    |-- Segment")
    for format_, first in (("svg", "<?xml"), ("ascii", "Mission")):
        assert run("render", "land_only", "--format", format_).stdout.startswith(first)


def test_a_picture_is_written(tmp_path: Path) -> None:
    out = tmp_path / "tree.svg"
    result = run("render", "land_only", "--format", "svg", "--out", out)
    assert result.stdout == f"written: {out}\n"
    assert out.read_text(encoding="utf-8").endswith("</svg>\n")


def test_a_foreign_tree_is_drawn_with_its_palette(tmp_path: Path) -> None:
    palette = tmp_path / "palette.xml"
    palette.write_text('<TreeNodesModel><Action ID="Dock"/></TreeNodesModel>', encoding="utf-8")
    path = tree_file(tmp_path, "<Dock/>")
    assert run("render", path, "--palette", palette).stdout == "Main\n`-- Dock\n"
    assert_refused(run("render", path), "unknown node 'Dock'", "mission.xml:3:1")


def test_a_tree_that_is_not_there_is_not_drawn(tmp_path: Path) -> None:
    assert_refused(run("render", tmp_path / "absent.xml"), "no such tree file")


# --- new ------------------------------------------------------------------------------------------


def test_a_new_mission_is_written_once_and_is_good(tmp_path: Path) -> None:
    path = tmp_path / "mine.xml"
    result = run("new", path, "--from", "land")
    assert (result.exit_code, result.stdout[: len(f"written: {path}")]) == (0, f"written: {path}")
    assert run("check", path).stdout == f"{path}: good\n"
    assert_refused(run("new", path), "not overwritten")
    assert_refused(run("new", tmp_path / "other.xml", "--from", "lan"), "--from")


def test_starters_are_offered_as_there_are() -> None:
    (option,) = (param for param in new.params if param.name == "start")
    assert tuple(option.type.choices) == tuple(STARTERS)


# --- all of them ----------------------------------------------------------------------------------


def test_the_tools_need_nothing_that_flies_or_draws_pictures(tmp_path: Path) -> None:
    """They start at once, and run where no simulator and no network runtime is installed."""
    (tmp_path / "script.yaml").write_text("default: S", encoding="utf-8")
    heavy = ("mujoco", "openvino", "torch", "cv2", "av", "rich", "sklearn", "zmq", "scipy")
    calls = [
        ["new", "mine.xml"],
        ["check", "mine.xml", "--format", "json"],
        ["nodes", "--format", "json"],
        ["schema"],
        ["render", "mine.xml", "--format", "svg"],
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
