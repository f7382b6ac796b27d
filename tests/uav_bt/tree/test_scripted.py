"""Scripted answers in place of leaves: mocks and dry runs."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.worlds.tables import cases
from tests.worlds.trees import World, document
from uav_bt.board import ELAPSED
from uav_bt.board.blackboard import Key
from uav_bt.errors import FileError, InputError, NodeFailedError, TreeError, ValueRangeError
from uav_bt.tree import (
    Leaf,
    MissionTree,
    NodeKind,
    NodeRegistry,
    Port,
    Status,
    load_tree,
    parse_tree,
)
from uav_bt.tree.dry_run import SimulatedTick, Simulation, read_script
from uav_bt.tree.scripted import AnswerScript, Mock, ScriptedLeaf

CASES = cases("answers")
OWN = Key("own", float, "a plug-in's own key")


class Fly(Leaf):
    """Needs hardware."""

    ports = (Port("speed_mps", float, default=1.0, doc="speed, m/s"),)
    reads = (ELAPSED,)
    writes = (OWN,)

    def __init__(self, *_arguments: object, **_given: object) -> None:
        raise RuntimeError("no hardware here")


class Clear(Leaf):
    """Asks the hardware."""

    condition = True


class Measure(Leaf):
    """Would measure."""

    DEPTH = Port("depth_m", float, direction="output", doc="m")
    PHASE_OUT = Port("phase", str, default="{@phase}", direction="output", doc="where we are")
    ports = (DEPTH, PHASE_OUT)


REGISTRY = NodeRegistry([Fly, Clear, Measure])
TREE = document(
    '<Sequence><Clear/><Fly name="out" speed_mps="2" _skipIf="nothing_to_do"/>'
    '<SubTree ID="Home"/></Sequence>',
    '<BehaviorTree ID="Home"><Fallback><Fly name="back"/><Fly name="back"/></Fallback>'
    "</BehaviorTree>",
)


def loaded(tmp_path: Path, world: World, **mocks: str) -> MissionTree:
    return loaded_by(tmp_path, world, mocks)


def loaded_by(tmp_path: Path, world: World, mocks: dict[str, str]) -> MissionTree:
    path = tmp_path / "mission.xml"
    path.write_text(TREE, encoding="utf-8")
    tree = load_tree(path, REGISTRY, mocks=mocks)
    world.board.declare(ELAPSED)
    tree.setup(world.context)
    tree.variables["nothing_to_do"] = False
    return tree


@pytest.mark.parametrize(("text", "answers"), CASES["letters"])
def test_a_script_is_answered_letter_by_letter(text: str, answers: str) -> None:
    script = AnswerScript.parse(text)
    assert "".join(script.answer(tick).letter for tick in range(7)) == answers


@pytest.mark.parametrize("text", CASES["refused"])
def test_other_texts_are_refused(text: str) -> None:
    with pytest.raises(ValueRangeError, match=r"R \(running\), S .* as in 'RRS' or 'F\(RS\)'"):
        AnswerScript.parse(text)


def test_mocks_keep_everything_but_the_code(tmp_path: Path, world: World) -> None:
    tree = loaded(tmp_path, world, Fly="R", Clear="S")
    out = tree.find("Main/Sequence/out")
    assert isinstance(out, ScriptedLeaf)
    assert (out.name, out.node_id, out.kind) == ("out", "Fly", NodeKind.ACTION)
    assert out.port_value("speed_mps") == 2.0
    assert (out.reads, out.writes) == ((ELAPSED,), (OWN,))
    assert tree.find("Clear").kind is NodeKind.CONDITION
    tree.variables["nothing_to_do"] = True
    tree.tick()
    assert out.node_status is Status.IDLE
    assert tree.find("Main/Sequence/Home/Fallback/back").node_status is Status.RUNNING


@pytest.mark.parametrize(("mocks", "answers"), CASES["selectors"])
def test_the_most_exact_selector_counts(
    mocks: dict[str, str], answers: tuple[str, ...], tmp_path: Path, world: World
) -> None:
    tree = loaded_by(tmp_path, world, mocks)
    texts = [leaf.script for leaf in tree.leaves() if isinstance(leaf, ScriptedLeaf)]
    assert texts == [AnswerScript.parse(text) for text in answers]


def test_a_mock_writes_its_outputs_when_it_succeeds(world: World) -> None:
    text = document('<Sequence><Measure name="m" depth_m="{d}"/><AlwaysSuccess/></Sequence>')
    mocks: dict[str, str | Mock] = {"Measure": Mock(outputs={"depth_m": "2.5"}), "m": "RS"}
    tree = parse_tree(text, REGISTRY, mocks=mocks)
    tree.setup(world.context)
    assert tree.tick() is Status.RUNNING
    assert "d" not in tree.variables.snapshot()
    assert tree.tick() is Status.SUCCESS
    assert tree.variables["d"] == 2.5
    with pytest.raises(
        TreeError, match=r"Measure 'm': mock of 'm': Measure has no output 'dept_m'"
    ):
        parse_tree(text, REGISTRY, mocks={"m": Mock("S", {"dept_m": 1})})
    with pytest.raises(TreeError, match="it has outputs, but Measure has no answers"):
        parse_tree(text, REGISTRY, mocks={"m": Mock(outputs={"depth_m": 1})})


@pytest.mark.parametrize(("selector", "script", "message"), CASES["unfit"])
def test_mocks_that_do_not_fit_are_refused(
    tmp_path: Path, world: World, selector: str, script: str, message: str
) -> None:
    with pytest.raises(TreeError, match=message) as error:
        loaded_by(tmp_path, world, {"Fly": "S", "Clear": "S", selector: script})
    assert isinstance(error.value, InputError)


# --- dry runs: the real tree, with leaves that follow a script ------------------------------------

DRY_RUNS = CASES["dry_runs"]
S, F, R, K = Status.SUCCESS, Status.FAILURE, Status.RUNNING, Status.SKIPPED


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
    body = '<Sequence><Fly name="up"/><Clear/><Fly name="down"/></Sequence>'
    done = ticks(tmp_path, body, "leaves: {up: RS, Main/Sequence/down: S, Clear: S}")
    assert [(step.tick, step.time_s, step.status) for step in done] == [(1, 0.0, R), (2, 0.1, S)]
    assert done[0].answers == (("up", R),)
    assert done[1].answers == (("up", S), ("Clear", S), ("down", S))


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
    body = '<Sequence>\n<Measure/>\n<Clear name="eye"/>\n<Measure name="m"/></Sequence>'
    with pytest.raises(TreeError) as error:
        ticks(tmp_path, body, "leaves: {m: S}")
    tree, script = tmp_path / "tree.xml", tmp_path / "script.yaml"
    first, second = error.value.findings
    assert first.startswith(
        f"{tree}:4:1: Measure 'Measure': has no answers in {script}: add 'Measure' to"
    )
    assert second.startswith(f"{tree}:5:1: Clear 'eye': has no answers in {script}: add 'eye' to")


@pytest.mark.parametrize(("script", "line", "message"), DRY_RUNS["unfit"])
def test_answers_that_do_not_fit_the_tree_are_refused_with_their_line(
    tmp_path: Path, script: str, line: int, message: str
) -> None:
    with pytest.raises(TreeError) as error:
        simulation(tmp_path, "<Sequence><Clear/><Fly/><Measure/></Sequence>", script)
    (finding,) = error.value.findings
    assert finding.startswith(f"{tmp_path / 'script.yaml'}:{line}:1: ")
    assert message in finding


@pytest.mark.parametrize(("script", "line", "message"), DRY_RUNS["board"])
def test_board_values_that_do_not_fit_are_refused_with_their_line(
    tmp_path: Path, script: str, line: int, message: str
) -> None:
    with pytest.raises(FileError) as error:
        simulation(tmp_path, "<Sequence><Clear/><Fly/><Measure/></Sequence>", script)
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


@pytest.mark.parametrize(("text", "line", "message"), DRY_RUNS["read"])
def test_what_no_script_can_say_is_refused_with_its_line(
    tmp_path: Path, text: str, line: int, message: str
) -> None:
    path = written(tmp_path, text)
    with pytest.raises(FileError) as error:
        read_script(path)
    assert message in str(error.value)
    assert error.value.line == line
