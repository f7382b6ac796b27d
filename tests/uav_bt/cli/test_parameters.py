"""`--set`, `--var` and `--params` of the commands that do not fly, and their refusals by all."""

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
VARIANTS = "variants: {one: {var: {laps: 2}}, two: {var: {laps: x}}}"


@pytest.fixture
def mission(tmp_path: Path) -> Path:
    return tree_file(tmp_path, BODY)


def file(folder: Path, text: str) -> Path:
    path = folder / "params.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def test_check_takes_values_from_the_command_line_and_from_a_file(
    mission: Path, tmp_path: Path
) -> None:
    params = file(tmp_path, "set: {HoverFor.seconds: 2}\nvar: {laps: 2}")
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
    params = file(tmp_path, "variants: {one: {var: {laps: 1}}, two: {var: {laps: y}}}")
    done = CliRunner().invoke(
        uav_bt, ["check", "-", "--params", str(params)], input=mission.read_bytes()
    )
    assert done.exit_code == 2
    assert f"{params}:1:1: variable 'laps': expected an integer, got 'y'" in done.stderr


def test_check_names_the_variant_that_fails_by_its_line(mission: Path, tmp_path: Path) -> None:
    params = file(tmp_path, VARIANTS.replace(", two", ",\n two"))
    assert_refused(run("check", mission, "--params", params), f"{params}:2:1: variable 'laps'")


def test_values_are_for_one_file(mission: Path, tmp_path: Path) -> None:
    for trees in ((mission, mission), (tmp_path,)):
        assert_refused(run("check", *trees, "--var", "laps=2"), "name one tree file")
    assert_refused(run("check", tmp_path / "no.xml", "--var", "laps=2"), "no such tree file")


def test_the_command_line_counts_before_the_script_of_a_dry_run(
    mission: Path, tmp_path: Path
) -> None:
    script = tmp_path / "answers.yaml"
    script.write_text("{default: S, variables: {laps: 1}}")
    assert run("simulate", mission, "--script", script).exit_code == 1  # of `laps > 1`
    assert run("simulate", mission, "--script", script, "--var", "laps=2").exit_code == 0
    drawn = run("tree", "render", mission, "--set", "HoverFor.seconds=7", "--var", "laps=2")
    assert "HoverFor seconds=7" in drawn.stdout


@pytest.mark.parametrize(
    "command",
    [("simulate", "--script", "answers.yaml"), ("tree", "render"), ("fly", "--drone", "plain")],
)
def test_variants_are_for_campaigns(
    mission: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: tuple[str, ...]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("answers.yaml").write_text("default: S")
    params = file(tmp_path, VARIANTS)
    assert_refused(run(*command, mission, "--params", params), "variants", "campaign")


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (("--var", "laps"), "expected NAME=VALUE, such as laps=3, got 'laps'"),
        (("--var", "=3"), "expected NAME=VALUE, such as laps=3, got '=3'"),
        (("--var", "laps=2", "--var", "laps=3"), "variable 'laps' is given two values"),
        (("--var", "laps=2", "--var", "lap=3"), "did you mean 'laps'?"),
        (("--set", "seconds=2"), "expected NODE.PORT=VALUE"),
        (("--params", "none.yaml"), "there is no such parameter file"),
    ],
)
@pytest.mark.parametrize("command", ["check", "fly"])
def test_a_wrong_value_is_refused(
    mission: Path, command: str, given: tuple[str, ...], message: str
) -> None:
    assert_refused(run(command, mission, *given), message)
