"""`uav-bt tree` and `simulate`: nodes, drawings, schemas, dry runs, and given values."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from tests.worlds.cli import HOP, assert_refused, run, tree_file
from tests.worlds.trees import document, subtree
from uav_bt.cli.root import uav_bt
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
    model = run("tree", "nodes", "--format", "xml").stdout
    assert ('ID="Explore"' in model, 'ID="Sequence"' in model) == (True, False)


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
    assert result.stdout.startswith(
        "Mission\n`-- ReactiveSequence 'mission'\n    |-- SubTree Perceive"
    )
    assert run("tree", "render", "land_only", "--format", "ascii").stdout == result.stdout
    out = tmp_path / "tree.svg"
    drawn = run("tree", "render", "land_only", "--format", "svg", "--out", out)
    assert drawn.stdout == f"written: {out}\n"
    assert out.read_text(encoding="utf-8").startswith("<?xml")


def test_a_foreign_tree_is_checked_and_drawn_with_its_palette(tmp_path: Path) -> None:
    palette = tmp_path / "palette.xml"
    palette.write_text('<TreeNodesModel><Action ID="Dock"/></TreeNodesModel>', encoding="utf-8")
    path = tree_file(tmp_path, "<Dock/>")
    assert run("check", path, "--palette", palette).stdout == f"{path}: good\n"
    assert run("tree", "render", path, "--palette", palette).stdout == "Main\n`-- Dock\n"
    assert 'name="node.Dock"' in run("tree", "schema", "--palette", palette).stdout
    assert_refused(run("tree", "render", path), "unknown node 'Dock'", "mission.xml:3:1")


# --- dry runs -------------------------------------------------------------------------------------


@pytest.fixture
def hop(tmp_path: Path) -> Path:
    return tree_file(tmp_path, HOP)


def simulate(folder: Path, tree: Path, answers: str, *more: object) -> Result:
    """Run a tree in a dry run, with a script of this text."""
    script = folder / "script.yaml"
    script.write_text(answers, encoding="utf-8")
    return run("simulate", tree, "--script", script, *more)


def test_the_table_leaves_out_ticks_that_repeat_others(hop: Path, tmp_path: Path) -> None:
    result = simulate(tmp_path, hop, "leaves: {TakeOff: RRRS, Land: RS}")
    assert result.exit_code == 0
    assert result.stdout.splitlines() == [
        " tick     time  root     leaves",
        "    1     0.00  RUNNING  TakeOff R",
        "    4     0.30  RUNNING  TakeOff S, Land R",
        "    5     0.40  SUCCESS  Land S",
        "SUCCESS after 5 ticks, 0.40 s",
    ]


def test_halts_and_changes_stand_in_the_line_of_their_tick(tmp_path: Path) -> None:
    body = '<Timeout msec="200" _onFailure="late := true"><Land/></Timeout>'
    result = simulate(tmp_path, tree_file(tmp_path, body), "default: R")
    assert result.exit_code == 1
    assert result.stdout.splitlines()[-2:] == [
        "    3     0.20  FAILURE  halted Land; late=1.0",
        "FAILURE after 3 ticks, 0.20 s",
    ]


def test_a_tree_that_does_not_end_fails(hop: Path, tmp_path: Path) -> None:
    result = simulate(tmp_path, hop, "default: R", "--ticks", 7, "--tick-s", 2)
    assert result.exit_code == 1
    assert result.stdout.splitlines()[-1] == "not ended after 7 ticks, 12.00 s"


def test_json_has_all_ticks(hop: Path, tmp_path: Path) -> None:
    result = simulate(tmp_path, hop, "leaves: {TakeOff: RF, Land: S}", "--format", "json")
    assert result.exit_code == 1
    report = json.loads(result.stdout)
    assert (report["tree"], report["status"]) == (str(hop), "FAILURE")
    first, second = report["ticks"]
    assert first == {
        "tick": 1,
        "time_s": 0.0,
        "status": "RUNNING",
        "leaves": [{"leaf": "TakeOff", "status": "RUNNING"}],
        "halted": [],
        "changed": {},
    }
    assert [one["status"] for one in second["leaves"]] == ["FAILURE"]


def test_a_node_that_raises_ends_it_with_a_message(tmp_path: Path) -> None:
    path = tree_file(tmp_path, '<Sequence><Land/><Script code="a := b"/></Sequence>')
    result = simulate(tmp_path, path, "leaves: {Land: RS}")
    assert result.exit_code == 1
    assert "    1     0.00  RUNNING  Land R" in result.stdout
    assert "Error: node 'Main/Sequence/Script' failed" in result.stderr
    assert "Traceback" not in result.stderr


def test_all_unset_variables_are_named_at_once(tmp_path: Path) -> None:
    body = (
        '<Sequence><Script code="set := 1; twice := set * given"/>'
        '<ScriptCondition code="charge &gt; least"/><SubTree ID="Inner" _autoremap="true"/>'
        "</Sequence>"
    )
    tree = tmp_path / "mission.xml"
    tree.write_text(document(body, subtree("Inner", '<AlwaysSuccess _skipIf="mode == 2"/>')))
    result = simulate(tmp_path, tree, "default: S\nvariables: {given: 2}\n")
    assert result.exit_code == 1
    assert "nothing in the tree file sets charge, least, mode" in result.stderr
    assert "variables: {charge: 0, least: 0, mode: 0}" in result.stderr
    answers = "default: S\nvariables: {given: 2, charge: 3, least: 1, mode: 2}\n"
    assert simulate(tmp_path, tree, answers).exit_code == 0
    failed = simulate(tmp_path, tree, answers.replace("given: 2", "given: a"))
    assert failed.exit_code == 1
    assert "nothing in the tree file sets" not in failed.stderr


# --- values ---------------------------------------------------------------------------------------

BODY = (
    '<Sequence><TakeOff/><Repeat num_cycles="{laps}"><HoverFor/></Repeat>'
    '<ScriptCondition code="laps &gt; 1"/><Land/></Sequence>'
)


@pytest.fixture
def mission(tmp_path: Path) -> Path:
    return tree_file(tmp_path, BODY)


def test_check_takes_values_from_command_line_and_file(mission: Path, tmp_path: Path) -> None:
    params = tmp_path / "params.yaml"
    params.write_text("set: {HoverFor.seconds: 2}\nvar: {laps: 2}", encoding="utf-8")
    for given in (
        ("--var", "laps=2"),
        ("--params", params),
        ("--params", params, "--var", "laps=3"),
    ):
        assert run("check", "--tree", "Main", mission, *given).stdout == f"{mission}: good\n"
    assert run("check", "--tree", "Main", mission).exit_code == 2
    wrong = run("check", mission, "--params", params, "--var", "laps=x")
    assert_refused(wrong, f"{mission}:1:1: variable 'laps': expected an integer, got 'x'")


def test_check_reads_a_pipe_once_for_all_variants(mission: Path, tmp_path: Path) -> None:
    params = tmp_path / "params.yaml"
    params.write_text("variants: {one: {var: {laps: 1}}, two: {var: {laps: y}}}")
    command = ["check", "-", "--params", str(params)]
    done = CliRunner().invoke(uav_bt, command, input=mission.read_bytes())
    assert_refused(done, f"{params}:1:1: variable 'laps': expected an integer, got 'y'")


def test_the_command_line_counts_before_a_script(mission: Path, tmp_path: Path) -> None:
    answers = "{default: S, variables: {laps: 1}}"
    assert simulate(tmp_path, mission, answers).exit_code == 1  # of `laps > 1`
    assert simulate(tmp_path, mission, answers, "--var", "laps=2").exit_code == 0
    drawn = run("tree", "render", mission, "--set", "HoverFor.seconds=7", "--var", "laps=2")
    assert "HoverFor seconds=7" in drawn.stdout
