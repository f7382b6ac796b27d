"""`--set`, `--var` and `--params` of the commands that do not fly."""

from __future__ import annotations

from pathlib import Path

import pytest
from click.testing import CliRunner

from tests.worlds.cli import assert_refused, run, tree_file
from uav_bt.cli.root import uav_bt

BODY = (
    '<Sequence><TakeOff/><Repeat num_cycles="{laps}"><HoverFor/></Repeat>'
    '<ScriptCondition code="laps &gt; 1"/><Land/></Sequence>'
)


@pytest.fixture
def mission(tmp_path: Path) -> Path:
    return tree_file(tmp_path, BODY)


def test_check_takes_values_from_the_command_line_and_from_a_file(
    mission: Path, tmp_path: Path
) -> None:
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


def test_the_command_line_counts_before_the_script_of_a_dry_run(
    mission: Path, tmp_path: Path
) -> None:
    script = tmp_path / "answers.yaml"
    script.write_text("{default: S, variables: {laps: 1}}")
    assert run("simulate", mission, "--script", script).exit_code == 1  # of `laps > 1`
    assert run("simulate", mission, "--script", script, "--var", "laps=2").exit_code == 0
    drawn = run("tree", "render", mission, "--set", "HoverFor.seconds=7", "--var", "laps=2")
    assert "HoverFor seconds=7" in drawn.stdout
