"""Control nodes and decorators of a palette tick like the nodes that a script names for them."""

from __future__ import annotations

from pathlib import Path

import pytest

from uav_bt.board import MISSION_KEYS
from uav_bt.board.blackboard import Blackboard
from uav_bt.board.context import MissionContext
from uav_bt.clock import ManualClock
from uav_bt.errors import FileError, InputError, NodeFailedError
from uav_bt.tree import MissionTree, NodeRegistry
from uav_bt.tree.dry_run import Simulation, read_script
from uav_bt.tree.loading.loader import check_file
from uav_bt.tree.loading.palette import read_palette, with_palette
from uav_bt.tree.nodes import ScriptNode

FILES = Path(__file__).parents[3] / "data" / "tree_files"
REGISTRY = with_palette(NodeRegistry(), read_palette(FILES / "palette.xml"))
TABLE = """
leaves: {PlanPath: FS, GoalChanged: F, DrivePath: RS}
default: S
nodes:
  RecoveryNode: {is: RetryUntilSuccessful, num_attempts: 3}
  PipelineSequence: Sequence
  RoundRobin: Fallback
  RateController: pass
"""


def simulation(folder: Path, text: str) -> Simulation:
    script = folder / "answers.yaml"
    script.write_text(text, encoding="utf-8")
    return Simulation(FILES / "navigate.xml", read_script(script), REGISTRY)


def test_a_foreign_tree_is_ticked(tmp_path: Path) -> None:
    """The first plan fails, the map is cleared, the second plan is driven."""
    ticks = list(simulation(tmp_path, TABLE).run(10))
    answers = [(one.leaf.rpartition("/")[2], one.status.letter) for t in ticks for one in t.answers]
    assert answers[:3] == [("PlanPath", "F"), ("ClearMap", "S"), ("PlanPath", "S")]
    assert answers[3:] == [("DrivePath", "R"), ("DrivePath", "S")]
    assert ticks[-1].status.name == "SUCCESS"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("  RateController: pass\n", "", "nothing says how to tick it: RateController; say"),
        ("RateController: pass", "RateControler: pass", "did you mean 'RateController'"),
        (": Sequence", ": Sequense", "cannot be 'Sequense': expected pass"),
        ("{is: RetryUntilSuccessful, num_attempts: 3}", "Repeat", "as Repeat needs num_cycles: wr"),
        ("num_attempts: 3", "attempts: 3", "has no port 'attempts'"),
    ],
)
def test_a_table_that_does_not_fit_is_refused(
    tmp_path: Path, old: str, new: str, message: str
) -> None:
    with pytest.raises(FileError, match=r"answers\.yaml") as error:
        simulation(tmp_path, TABLE.replace(old, new))
    assert message in str(error.value)


FOREIGN_KEYS = """
<root BTCPP_format="4"><BehaviorTree ID="Main"><Sequence>
  <PlanPath goal="{@goal}" path="{@path}"/>
  <Script code="next := @stage + 1"/>
  <ScriptCondition code="@armed"/>
</Sequence></BehaviorTree></root>
"""


def test_keys_of_a_foreign_board_are_what_the_script_gives(tmp_path: Path) -> None:
    tree, answers = tmp_path / "tree.xml", tmp_path / "answers.yaml"
    tree.write_text(FOREIGN_KEYS, encoding="utf-8")
    answers.write_text("default: S\nboard: {stage: 2, armed: true}", encoding="utf-8")
    (tick,) = Simulation(tree, read_script(answers), REGISTRY).run(3)
    assert tick.status.name == "SUCCESS"
    assert tick.changed["next"] == 3


def test_keys_of_a_foreign_board_without_a_value_are_named(tmp_path: Path) -> None:
    tree, answers = tmp_path / "tree.xml", tmp_path / "answers.yaml"
    tree.write_text(FOREIGN_KEYS, encoding="utf-8")
    answers.write_text("default: S\nboard: {goal: 1}", encoding="utf-8")
    with pytest.raises(NodeFailedError, match="'@stage' has no value") as error:
        list(Simulation(tree, read_script(answers), REGISTRY).run(3))
    assert "as in board: {path: 0, stage: 0}" in error.value.__notes__[0]


def test_scripts_write_keys_of_a_foreign_board(tmp_path: Path) -> None:
    tree, answers = tmp_path / "tree.xml", tmp_path / "answers.yaml"
    code = "@x := 0.5; @x += 2; goal := @x; inner := 1"
    tree.write_text(
        '<root BTCPP_format="4" main_tree_to_execute="Main"><BehaviorTree ID="Main"><Sequence>'
        f'<Script code="{code}"/><SubTree ID="In" mine="{{@x}}"/></Sequence></BehaviorTree>'
        '<BehaviorTree ID="In"><Script code="mine += 1"/></BehaviorTree></root>',
        encoding="utf-8",
    )
    answers.write_text("default: S", encoding="utf-8")
    assert check_file(tree, REGISTRY) == ()
    (tick,) = Simulation(tree, read_script(answers), REGISTRY).run(3)
    assert (tick.changed["goal"], tick.changed["@x"]) == (2.5, 3.5)
    (finding,) = check_file(tree, NodeRegistry())[:1]
    assert "'@x' is a board key; leaves write those, scripts only read" in finding.message


def test_no_script_writes_our_own_keys_on_a_foreign_board(tmp_path: Path) -> None:
    tree = tmp_path / "tree.xml"
    tree.write_text(
        '<root BTCPP_format="4"><BehaviorTree ID="M"><Script code="@elapsed_s := 1"/>'
        "</BehaviorTree></root>",
        encoding="utf-8",
    )
    (finding,) = check_file(tree, REGISTRY)
    assert "'@elapsed_s' is a board key; leaves write those" in finding.message


def test_a_composed_tree_whose_script_writes_the_board_is_refused_before_it_is_ticked() -> None:
    clock = ManualClock()
    tree = MissionTree(ScriptNode("s", code="@elapsed_s := 1"))
    with pytest.raises(InputError, match="'@elapsed_s' is a board key; leaves write those"):
        tree.setup(MissionContext(board=Blackboard(clock, MISSION_KEYS), clock=clock))
