"""Behaviour of control nodes and decorators; recorded traces test the rest."""

from __future__ import annotations

from typing import Any

import pytest

from tests.conformance import Scripted
from tests.worlds.tables import cases
from tests.worlds.trees import World, document, leaf, subtree
from uav_bt.board import HEIGHT, PHASE
from uav_bt.errors import InputError, MissionError, NodeFailedError, TreeError
from uav_bt.tree import Leaf, MissionTree, NodeRegistry, Port, Status, parse_tree
from uav_bt.tree.nodes import Parallel, Repeat

CASES = cases("missions")

A, B = leaf("a", "S"), leaf("b", "S")
LABELS = " ".join(f'case_{n}="{n}"' for n in range(1, 6))
SIX = "".join(leaf(name, "S") for name in "abcdef")


def letters(tree: MissionTree, ticks: int) -> str:
    return "".join(tree.tick().letter for _ in range(ticks))


def timed(world: World, body: str, *steps_s: float) -> str:
    """Return the answers of ticks; the clock goes on after each."""
    tree, answers = world.tree(body), ""
    for step_s in steps_s:
        answers += tree.tick().letter
        world.clock.advance(step_s)
    return answers


def test_timers_follow_the_missions_clock(world: World) -> None:
    assert timed(world, f'<Timeout msec="300">{leaf("a", "R")}</Timeout>', *[0.1] * 5) == "RRRFR"
    assert world.events() == ["start a", "running a", "running a", "halt a", "start a"]
    assert timed(world, f'<Timeout msec="0">{leaf("a", "R")}</Timeout>', *[1000.0] * 3) == "RRR"
    world.events()
    assert timed(world, f'<Delay delay_msec="500">{A}</Delay>', 0.0, 0.2, 0.3, 0.0) == "RRRS"
    assert world.events() == ["start a"]


@pytest.mark.parametrize(("before", "parallel"), CASES["parallels"])
def test_a_parallel_counts_only_its_children(world: World, before: str, parallel: str) -> None:
    body = f"<Sequence>{before}<{parallel}>{A}{B}</{parallel.split(maxsplit=1)[0]}></Sequence>"
    if "n + 2" not in before:
        with pytest.raises(TreeError, match="expected at most its 2 children, got 3"):
            world.tree(body)
        return
    with pytest.raises(NodeFailedError, match="must not exceed the 2 children") as error:
        world.tree(body).tick()
    assert isinstance(error.value.__cause__, MissionError)


@pytest.mark.parametrize(("variable", "child"), CASES["switches"])
def test_switch5_compares_texts_and_numbers(world: World, variable: object, child: str) -> None:
    tree = world.tree(f'<Switch5 variable="{{v}}" {LABELS}>{SIX}</Switch5>')
    if variable is not None:
        tree.variables["v"] = variable
    assert tree.tick() is Status.SUCCESS
    assert world.events() == [f"start {child}"]


@pytest.mark.parametrize(("node", "queue", "elements"), CASES["loops"])
def test_loops_convert_their_elements(
    world: World, node: str, queue: str, elements: list[object]
) -> None:
    for given in (queue, "{q}", "{q}"):
        tree = world.tree(f'<{node} queue="{given}" value="{{v}}" if_empty="FAILURE">{A}</{node}>')
        tree.variables["q"] = queue
        seen = []
        while tree.tick() is Status.RUNNING:
            seen.append(tree.variables["v"])
        assert seen == elements
        assert [type(value) for value in seen] == [type(element) for element in elements]


def test_a_queue_in_a_variable_is_used_up(world: World) -> None:
    tree = world.tree(f'<LoopInt queue="{{q}}" value="{{v}}">{A}</LoopInt>')
    queue = [4, 5]
    tree.variables["q"] = queue
    assert letters(tree, 4) == "RRSS"
    assert (queue, tree.variables["v"]) == ([], 5)
    for wrong, message in ((3, "expected a list, or a text like 1;2;3, got int"), ("x", "'x'")):
        tree.variables["q"] = wrong
        with pytest.raises(NodeFailedError, match=message):
            tree.tick()


def test_set_copies_and_keeps_types(world: World) -> None:
    """`{source}` copies any value; a text is converted to the type of an existing variable."""
    tree = world.tree(
        '<Sequence><SetBlackboard value="{source}" output_key="copy"/>'
        '<SetBlackboard value="7" output_key="count"/>'
        '<SetBlackboard value="7" output_key="word"/><UnsetBlackboard key="gone"/></Sequence>'
    )
    thing = object()
    for name, value in (("source", thing), ("count", 1), ("gone", 1)):
        tree.variables[name] = value
    assert letters(tree, 2) == "SS"
    assert tree.variables.snapshot() == {"source": thing, "copy": thing, "count": 7, "word": "7"}
    tree.variables["count"] = 1.5
    del tree.variables["source"]
    with pytest.raises(NodeFailedError, match=r"port 'value': \{source\} holds nothing"):
        tree.tick()


@pytest.mark.parametrize("node", ["IfThenElse", "WhileDoElse"])
def test_a_skipped_condition_is_an_error(world: World, node: str) -> None:
    """The engine throws an exception here, too."""
    tree = world.tree(f"<{node}>{leaf('a', 'K')}{B}</{node}>")
    with pytest.raises(NodeFailedError, match="must not be skipped") as error:
        tree.tick()
    assert isinstance(error.value.__cause__, MissionError)


# --- trees composed in Python ---------------------------------------------------------------------


def test_composing_checks_ports_and_children() -> None:
    with pytest.raises(InputError, match="did you mean 'num_cycles'"):
        Repeat("r", Scripted("a", script="S"), num_cycle=2)
    with pytest.raises(TypeError, match=r"uav_bt\.tree node"):
        Parallel("p", [object()])  # type: ignore[list-item]


# --- variables of subtrees, and keys of the board as their entries --------------------------------


class Climb(Leaf):
    """Climbs."""

    HEIGHT_M = Port("height_m", float, doc="height, m")
    PHASE_OUT = Port("phase", str, doc="what it does", direction="output")
    ports = (HEIGHT_M, PHASE_OUT)

    seen: float | None = None

    def update(self) -> Status:
        self.seen = self.port(self.HEIGHT_M)
        self.set_port(self.PHASE_OUT, "climb")
        return Status.SUCCESS


CLIMB = '<Climb height_m="{h}" phase="{p}"/>'
ENTRIES = 'h="{@height_above_ground_m}" p="{@phase}"'


def fly(world: World, attributes: str, inside: str, *more: str) -> tuple[MissionTree, Any]:
    """Return a tree that is only a subtree, set up on a board with a height, and its first leaf."""
    text = document(f'<SubTree ID="In" {attributes}/>', subtree("In", inside), *more)
    tree = parse_tree(text, NodeRegistry([Climb]))
    world.board.declare(HEIGHT)
    world.board.declare(PHASE)
    tree.setup(world.context)
    world.board.write(HEIGHT, 1.25)
    return tree, next(tree.leaves())


def test_a_literal_entry_is_the_subtrees_own_until_it_is_removed(world: World) -> None:
    """With `_autoremap`, a literal hides the outer tree's variable, and does not overwrite it."""
    code = '<Sequence><Script code="a := h"/><UnsetBlackboard key="h"/><Script code="b := h"/>'
    inner = subtree("In", f"{code}</Sequence>")
    tree = world.tree('<SubTree ID="In" _autoremap="true" h="2"/>', inner)
    tree.variables["h"] = 7
    assert tree.tick() is Status.SUCCESS
    assert tree.variables.snapshot() == {"h": 7, "a": 2, "b": 7}


@pytest.mark.parametrize("door", [None, 'h="{h}" p="{p}"', '_autoremap="true"'])
def test_ports_read_and_write_the_board_through_subtrees(world: World, door: str | None) -> None:
    inside = CLIMB if door is None else f'<SubTree ID="Deep" {door}/>'
    more = () if door is None else (subtree("Deep", CLIMB),)
    tree, climb = fly(world, ENTRIES, inside, *more)
    assert tree.tick() is Status.SUCCESS
    assert climb.seen == 1.25
    assert world.board.read(PHASE).value == "climb"
    assert list(tree.variables) == []


def test_a_board_entry_is_read_by_scripts_and_written_by_nobody(world: World) -> None:
    inside = '<Sequence><Script code="{code}"/><AlwaysSuccess _failureIf="h &lt; 2"/></Sequence>'
    tree, _ = fly(world, f'code="{{c}}" {ENTRIES}', inside)
    tree.variables["c"] = "x := h * 2"
    assert tree.tick() is Status.FAILURE
    world.board.write(HEIGHT, 2.5)
    assert tree.tick() is Status.SUCCESS
    tree.variables["c"] = "h = 3"
    with pytest.raises(NodeFailedError, match="'h' is '@height_above_ground_m'; leaves write"):
        tree.tick()
    sets = '<SetBlackboard value="1" output_key="{target}"/>'
    tree, _ = fly(world, f'target="{{n}}" {ENTRIES}', sets)
    tree.variables["n"] = "fine"
    assert tree.tick() is Status.SUCCESS
    tree.variables["n"] = "h"
    with pytest.raises(NodeFailedError, match="variable 'h' is the board key"):
        tree.tick()


@pytest.mark.parametrize("entry", ["{h}", "h", "{@height_above_ground_m}"])
def test_updates_of_the_board_are_seen(world: World, entry: str) -> None:
    tree, _ = fly(world, ENTRIES, f'<WasEntryUpdated entry="{entry}"/>')
    answers = letters(tree, 2)
    world.clock.advance(0.1)
    world.board.write(HEIGHT, 1.25)
    assert answers + letters(tree, 2) == "SFSF"
