"""Dry runs: the real tree, with leaves that follow the script."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.worlds.tables import cases
from uav_bt.errors import FileError, NodeFailedError, TreeError
from uav_bt.tree import Leaf, NodeRegistry, Port, Status
from uav_bt.tree.dry_run import SimulatedTick, Simulation, read_script

CASES = cases("answers")["dry_runs"]
S, F, R, K = Status.SUCCESS, Status.FAILURE, Status.RUNNING, Status.SKIPPED


class Fly(Leaf):
    """Would fly; the three have no `update`, which a dry run must not call."""


class Measure(Leaf):
    """Would measure."""

    DEPTH = Port("depth_m", float, direction="output", doc="m")
    PHASE_OUT = Port("phase", str, default="{@phase}", direction="output", doc="where we are")
    ports = (DEPTH, PHASE_OUT)


class Sees(Leaf):
    """Would look."""

    condition = True


REGISTRY = NodeRegistry([Fly, Measure, Sees])


def simulation(
    folder: Path, body: str, script: str, *, tick_s: float = 0.1, more: str = ""
) -> Simulation:
    tree, answers = folder / "tree.xml", folder / "script.yaml"
    tree.write_text(
        '<root BTCPP_format="4" main_tree_to_execute="Main">\n'
        f'<BehaviorTree ID="Main">\n{body}\n</BehaviorTree>{more}</root>',
        encoding="utf-8",
    )
    answers.write_text(script, encoding="utf-8")
    return Simulation(tree, read_script(answers), REGISTRY, tick_s=tick_s)


def ticks(folder: Path, body: str, script: str, count: int = 20) -> list[SimulatedTick]:
    return list(simulation(folder, body, script).run(count))


def test_leaves_answer_their_scripts_until_the_root_ends(tmp_path: Path) -> None:
    body = '<Sequence><Fly name="up"/><Sees/><Fly name="down"/></Sequence>'
    done = ticks(tmp_path, body, "leaves: {up: RS, Main/Sequence/down: S, Sees: S}")
    assert [(step.tick, step.time_s, step.status) for step in done] == [(1, 0.0, R), (2, 0.1, S)]
    assert done[0].answers == (("up", R),)
    assert done[1].answers == (("up", S), ("Sees", S), ("down", S))


def test_the_default_is_for_leaves_without_answers_only(tmp_path: Path) -> None:
    body = '<Sequence><Fly name="Measure"/><Measure name="m"/><Fly/></Sequence>'
    (step,) = ticks(tmp_path, body, "leaves: {Main/Sequence/Measure: R}\ndefault: F", count=1)
    assert step.answers == (("Measure", R),)
    (step,) = ticks(tmp_path, body, "leaves: {Fly: S}\ndefault: F")
    assert [status for _, status in step.answers] == [S, F]


def test_built_in_leaves_run_and_their_changes_are_reported(tmp_path: Path) -> None:
    body = (
        '<Sequence><Script code="a := 1; b := 2"/><Fly/>'
        '<Script code="a := 1; b := 3"/><UnsetBlackboard key="a"/></Sequence>'
    )
    first, second = ticks(tmp_path, body, "default: RS")
    assert first.changed == {"a": 1, "b": 2}
    assert second.changed == {"a": None, "b": 3}


def test_variables_and_board_are_there_from_the_first_tick(tmp_path: Path) -> None:
    body = "<ScriptCondition code=\"laps == 3 &amp;&amp; @phase == 'search'\"/>"
    (step,) = ticks(
        tmp_path, body, "default: S\nvariables: {laps: 3}\nboard: {phase: search}", count=1
    )
    assert (step.status, step.changed) == (S, {})


def test_the_board_tells_the_time_and_does_not_grow_old(tmp_path: Path) -> None:
    condition = '<ScriptCondition code="@elapsed_s &lt; 5.5"/>'
    body = f"<KeepRunningUntilFailure>{condition}</KeepRunningUntilFailure>"
    done = list(simulation(tmp_path, body, "default: S", tick_s=1.0).run(20))
    assert [step.time_s for step in done] == [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0]


def test_leaves_without_answers_are_all_named_with_their_places(tmp_path: Path) -> None:
    with pytest.raises(TreeError) as error:
        ticks(tmp_path, '<Sequence>\n<Fly/>\n<Sees name="eye"/>\n<Measure/></Sequence>',
              "leaves: {Measure: S}")  # fmt: skip
    tree, script = tmp_path / "tree.xml", tmp_path / "script.yaml"
    first, second = error.value.findings
    assert first.startswith(f"{tree}:4:1: Fly 'Fly': has no answers in {script}: add 'Fly' to")
    assert second.startswith(f"{tree}:5:1: Sees 'eye': has no answers in {script}: add 'eye' to")


@pytest.mark.parametrize(("script", "line", "message"), CASES["unfit"])
def test_answers_that_do_not_fit_the_tree_are_refused_with_their_line(
    tmp_path: Path, script: str, line: int, message: str
) -> None:
    with pytest.raises(TreeError) as error:
        simulation(tmp_path, "<Sequence><Sees/><Fly/><Measure/></Sequence>", script)
    (finding,) = error.value.findings
    assert finding.startswith(f"{tmp_path / 'script.yaml'}:{line}:1: ")
    assert message in finding


@pytest.mark.parametrize(("script", "line", "message"), CASES["board"])
def test_board_values_that_do_not_fit_are_refused_with_their_line(
    tmp_path: Path, script: str, line: int, message: str
) -> None:
    with pytest.raises(FileError) as error:
        simulation(tmp_path, "<Sequence><Sees/><Fly/><Measure/></Sequence>", script)
    assert message in str(error.value)
    assert (error.value.path, error.value.line) == (tmp_path / "script.yaml", line)


def test_a_node_that_raises_ends_the_dry_run_and_names_what_is_unset(tmp_path: Path) -> None:
    with pytest.raises(NodeFailedError) as caught:
        ticks(tmp_path, '<Script code="a := 1 / nothing"/>', "default: S")
    assert "in variables: {nothing: 0}" in caught.value.__notes__[0]


# --- the script ----------------------------------------------------------------------------------


def written(folder: Path, text: str) -> Path:
    path = folder / "script.yaml"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize(("text", "line", "message"), CASES["read"])
def test_what_no_script_can_say_is_refused_with_its_line(
    tmp_path: Path, text: str, line: int, message: str
) -> None:
    path = written(tmp_path, text)
    with pytest.raises(FileError) as error:
        read_script(path)
    assert message in str(error.value)
    assert error.value.line == line
