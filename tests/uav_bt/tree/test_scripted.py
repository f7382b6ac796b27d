"""Scripted leaves, and the loader that replaces other leaves by them."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.worlds.tables import cases
from tests.worlds.trees import World, document
from uav_bt.board import ELAPSED
from uav_bt.board.blackboard import Key
from uav_bt.errors import InputError, TreeError, ValueRangeError
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


REGISTRY = NodeRegistry([Fly, Clear])
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
    class Measure(Leaf):
        """Needs a sensor."""

        ports = (Port("depth_m", float, direction="output", doc="depth, m"),)

    text = document('<Sequence><Measure name="m" depth_m="{d}"/><AlwaysSuccess/></Sequence>')
    mocks: dict[str, str | Mock] = {"Measure": Mock(outputs={"depth_m": "2.5"}), "m": "RS"}
    tree = parse_tree(text, NodeRegistry([Measure]), mocks=mocks)
    tree.setup(world.context)
    assert tree.tick() is Status.RUNNING
    assert "d" not in tree.variables.snapshot()
    assert tree.tick() is Status.SUCCESS
    assert tree.variables["d"] == 2.5
    with pytest.raises(
        TreeError, match=r"Measure 'm': mock of 'm': Measure has no output 'dept_m'"
    ):
        parse_tree(text, NodeRegistry([Measure]), mocks={"m": Mock("S", {"dept_m": 1})})
    with pytest.raises(TreeError, match="it has outputs, but Measure has no answers"):
        parse_tree(text, NodeRegistry([Measure]), mocks={"m": Mock(outputs={"depth_m": 1})})


@pytest.mark.parametrize(("selector", "script", "message"), CASES["unfit"])
def test_mocks_that_do_not_fit_are_refused(
    tmp_path: Path, world: World, selector: str, script: str, message: str
) -> None:
    with pytest.raises(TreeError, match=message) as error:
        loaded_by(tmp_path, world, {"Fly": "S", "Clear": "S", selector: script})
    assert isinstance(error.value, InputError)
