"""Nodes and uses that the recorded traces do not cover, built from the engine's documentation."""

from __future__ import annotations

import pytest

from tests.worlds.trees import World, leaf
from uav_bt.board import HEIGHT
from uav_bt.errors import MissionError, NodeFailedError
from uav_bt.tree import Status


@pytest.mark.parametrize(
    ("variable", "child"), [("1", "a"), (3, "c"), ("5.0", "e"), (5.0, "e"), ("x", "f"), (None, "f")]
)
def test_switch5_compares_texts_and_numbers(world: World, variable: object, child: str) -> None:
    """The first equal case is chosen; without a value or a match it is the last child."""
    cases = " ".join(f'case_{n}="{n}"' for n in range(1, 6))
    body = "".join(leaf(name, "S") for name in "abcdef")
    tree = world.tree(f'<Switch5 variable="{{v}}" {cases}>{body}</Switch5>')
    if variable is not None:
        tree.variables["v"] = variable
    assert tree.tick() is Status.SUCCESS
    assert world.events() == [f"start {child}"]


@pytest.mark.parametrize(
    ("node", "queue", "elements"),
    [
        ("LoopDouble", "1.5;2", [1.5, 2.0]),
        ("LoopBool", "true;0", [True, False]),
        ("LoopString", "a;b;", ["a", "b"]),
        ("LoopInt", "", []),
    ],
)
def test_loops_convert_their_elements(
    world: World, node: str, queue: str, elements: list[object]
) -> None:
    """Each element is written with the loop's type; after the last one `if_empty` counts."""
    tree = world.tree(
        f'<{node} queue="{queue}" value="{{v}}" if_empty="FAILURE">{leaf("a", "S")}</{node}>'
    )
    seen = []
    while tree.tick() is Status.RUNNING:
        seen.append(tree.variables["v"])
    assert seen == elements
    assert [type(value) for value in seen] == [type(element) for element in elements]


def test_a_queue_in_a_variable_is_used_up(world: World) -> None:
    """The list in the variable becomes empty, so a second loop has no elements."""
    tree = world.tree(f'<LoopInt queue="{{q}}" value="{{v}}">{leaf("a", "S")}</LoopInt>')
    queue = [4, 5]
    tree.variables["q"] = queue
    answers = [tree.tick() for _ in range(4)]
    assert answers == [Status.RUNNING, Status.RUNNING, Status.SUCCESS, Status.SUCCESS]
    assert queue == []
    assert tree.variables["v"] == 5
    tree.variables["q"] = 3
    with pytest.raises(NodeFailedError, match="expected a list, or a text like 1;2;3, got int"):
        tree.tick()


def test_a_text_in_a_variable_is_a_queue_at_each_activation(world: World) -> None:
    tree = world.tree(f'<LoopInt queue="{{q}}" value="{{v}}">{leaf("a", "S")}</LoopInt>')
    seen = []
    for text in ("4;5", "4;5", "6"):
        tree.variables["q"] = text
        while tree.tick() is Status.RUNNING:
            seen.append(tree.variables["v"])
    assert seen == [4, 5, 4, 5, 6]
    tree.variables["q"] = "4;x"
    with pytest.raises(NodeFailedError, match="expected an integer, got 'x'"):
        tree.tick()


def test_unset_removes_a_variable(world: World) -> None:
    """It removes the value; a second time it has no effect."""
    tree = world.tree('<UnsetBlackboard key="v"/>')
    tree.variables["v"] = 1
    assert [tree.tick(), tree.tick()] == [Status.SUCCESS] * 2
    assert "v" not in tree.variables


def test_set_copies_and_keeps_types(world: World) -> None:
    """`{source}` copies any value; a text is converted to the type of an existing variable."""
    tree = world.tree(
        '<Sequence><SetBlackboard value="{source}" output_key="copy"/>'
        '<SetBlackboard value="7" output_key="count"/>'
        '<SetBlackboard value="7" output_key="word"/></Sequence>'
    )
    thing = object()
    tree.variables["source"] = thing
    tree.variables["count"] = 1
    assert tree.tick() is Status.SUCCESS
    assert tree.variables["copy"] is thing
    assert tree.variables.get("count") == 7
    assert tree.variables.get("word") == "7"
    tree.variables["count"] = 1.5
    del tree.variables["source"]
    with pytest.raises(NodeFailedError, match=r"port 'value': \{source\} holds nothing"):
        tree.tick()


def test_updates_of_the_board_are_seen(world: World) -> None:
    """A key of the mission board that was written again counts as updated."""
    world.board.declare(HEIGHT)
    tree = world.tree('<WasEntryUpdated entry="{@height_above_ground_m}"/>')
    answers = [tree.tick()]
    world.board.write(HEIGHT, 1.0)
    answers += [tree.tick(), tree.tick()]
    world.clock.advance(0.1)
    world.board.write(HEIGHT, 1.0)
    answers += [tree.tick(), tree.tick()]
    assert [answer.name[0] for answer in answers] == ["F", "S", "F", "S", "F"]


@pytest.mark.parametrize("node", ["IfThenElse", "WhileDoElse"])
def test_a_skipped_condition_is_an_error(world: World, node: str) -> None:
    """The engine throws an exception here, too."""
    tree = world.tree(f"<{node}>{leaf('a', 'K')}{leaf('b', 'S')}</{node}>")
    with pytest.raises(NodeFailedError, match="must not be skipped") as error:
        tree.tick()
    assert isinstance(error.value.__cause__, MissionError)


def test_a_failing_condition_names_its_node(world: World) -> None:
    """A script that fails stops the tree like an exception in a leaf."""
    tree = world.tree(f'<Sequence>{leaf("a", "R")}<AlwaysSuccess _skipIf="no > 1"/></Sequence>')
    assert tree.tick() is Status.RUNNING
    tree = world.tree('<AlwaysSuccess name="x" _onSuccess="n += 1"/>')
    with pytest.raises(NodeFailedError, match="node 'Main/x' failed: ScriptError: script 'n"):
        tree.tick()
    assert tree.root.node_status is Status.IDLE


def test_conditions_read_the_board(world: World) -> None:
    """`@key` in a condition is a key of the mission board."""
    world.board.declare(HEIGHT)
    tree = world.tree('<AlwaysSuccess _failureIf="@height_above_ground_m &lt; 1"/>')
    world.board.write(HEIGHT, 0.5)
    assert tree.tick() is Status.FAILURE
    world.board.write(HEIGHT, 1.5)
    assert tree.tick() is Status.SUCCESS


def test_conditions_in_python_too(world: World) -> None:
    """Trees composed in Python have conditions with the same names."""
    from uav_bt.tree import MissionTree  # noqa: PLC0415
    from uav_bt.tree.nodes import AlwaysSuccess  # noqa: PLC0415

    tree = MissionTree(AlwaysSuccess("x", _skipIf="n > 1", _post="n += 1"))
    tree.setup(world.context)
    tree.variables["n"] = 0
    assert [tree.tick().name for _ in range(3)] == ["SUCCESS", "SUCCESS", "SKIPPED"]
