"""`{@key}` as a SubTree entry, and private variables of a subtree, in flight."""

from __future__ import annotations

import pytest

from tests.worlds.trees import World, document, leaf
from uav_bt.board import HEIGHT, PHASE
from uav_bt.errors import BoardAccessError, NodeFailedError
from uav_bt.tree import Leaf, MissionTree, NodeRegistry, Port, Status, parse_tree


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


def fly(world: World, door: str, inside: str, *more: str) -> MissionTree:
    """Return a tree, set up on a board with a height, whose only node is a subtree."""
    text = document(door, f'<BehaviorTree ID="In">{inside}</BehaviorTree>', *more)
    tree = parse_tree(text, NodeRegistry([Climb]))
    world.board.declare(HEIGHT)
    world.board.declare(PHASE)
    tree.setup(world.context)
    world.board.write(HEIGHT, 1.25)
    return tree


def seen(tree: MissionTree) -> float | None:
    """Return the last value that the climbing leaf read."""
    climb = tree.find("Climb")
    assert isinstance(climb, Climb)
    return climb.seen


CLIMB = '<Climb height_m="{h}" phase="{p}"/>'
ENTRIES = 'h="{@height_above_ground_m}" p="{@phase}"'


def test_ports_read_and_write_the_board_through_a_subtree(world: World) -> None:
    """The inner variable is the board key, with the access that the ports declare."""
    tree = fly(world, f'<SubTree ID="In" {ENTRIES}/>', CLIMB)
    assert tree.tick() is Status.SUCCESS
    assert seen(tree) == 1.25
    assert world.board.read(PHASE).value == "climb"
    assert list(tree.variables) == []


@pytest.mark.parametrize("door", ['h="{h}" p="{p}"', '_autoremap="true"'])
def test_board_entries_pass_through_further_subtrees(world: World, door: str) -> None:
    """A name that is remapped or shared again is still the key."""
    tree = fly(
        world,
        f'<SubTree ID="In" {ENTRIES}/>',
        f'<SubTree ID="Deep" {door}/>',
        f'<BehaviorTree ID="Deep">{CLIMB}</BehaviorTree>',
    )
    assert tree.tick() is Status.SUCCESS
    assert seen(tree) == 1.25


def test_access_is_checked_leaf_by_leaf(world: World) -> None:
    """A leaf whose port is not connected to a key cannot reach it."""
    tree = fly(world, '<SubTree ID="In" h="2" p="{@phase}"/>', CLIMB)
    assert tree.tick() is Status.SUCCESS
    climb = tree.find("Climb")
    assert isinstance(climb, Climb)
    with pytest.raises(BoardAccessError, match="without declaring it"):
        climb.read(HEIGHT)


def test_scripts_read_a_board_entry_and_cannot_write_it(world: World) -> None:
    """A script sees the value by the inner name; `{code}` that writes it fails in flight."""
    inside = '<Sequence><Script code="{code}"/><AlwaysSuccess _failureIf="h &lt; 2"/></Sequence>'
    tree = fly(world, f'<SubTree ID="In" code="{{c}}" {ENTRIES}/>', inside)
    tree.variables["c"] = "x := h * 2"
    assert tree.tick() is Status.FAILURE
    world.board.write(HEIGHT, 2.5)
    assert tree.tick() is Status.SUCCESS
    tree.variables["c"] = "h = 3"
    with pytest.raises(
        NodeFailedError, match="'h' is '@height_above_ground_m'; leaves write those"
    ):
        tree.tick()


def test_nodes_that_write_by_name_cannot_write_a_board_entry(world: World) -> None:
    """A name that is only known in flight is refused in flight."""
    inside = '<SetBlackboard value="1" output_key="{target}"/>'
    tree = fly(world, f'<SubTree ID="In" target="{{n}}" {ENTRIES}/>', inside)
    tree.variables["n"] = "fine"
    assert tree.tick() is Status.SUCCESS
    tree.variables["n"] = "h"
    with pytest.raises(NodeFailedError, match="variable 'h' is the board key"):
        tree.tick()


@pytest.mark.parametrize("entry", ["{h}", "h"])
def test_updates_of_a_board_entry_are_seen(world: World, entry: str) -> None:
    """A key that is written again counts as updated under its inner name, too."""
    tree = fly(world, f'<SubTree ID="In" {ENTRIES}/>', f'<WasEntryUpdated entry="{entry}"/>')
    answers = [tree.tick(), tree.tick()]
    world.clock.advance(0.1)
    world.board.write(HEIGHT, 1.25)
    answers.append(tree.tick())
    assert [answer.name[0] for answer in answers] == ["S", "F", "S"]


def test_a_literal_entry_is_the_subtrees_own_though_all_else_is_shared(world: World) -> None:
    """With `_autoremap`, a literal does not overwrite the outer tree's variable."""
    tree = world.tree(
        '<SubTree ID="In" _autoremap="true" h="2"/>',
        '<BehaviorTree ID="In"><Script code="seen := h; k := 1"/></BehaviorTree>',
    )
    tree.variables["h"] = 7
    assert tree.tick() is Status.SUCCESS
    assert tree.variables.snapshot() == {"h": 7, "seen": 2, "k": 1}


def test_removing_a_literal_entry_uncovers_the_outer_variable(world: World) -> None:
    """The target of a name is resolved again after a possible change."""
    tree = world.tree(
        '<SubTree ID="In" _autoremap="true" h="2"/>',
        '<BehaviorTree ID="In"><Sequence><Script code="a := h"/><UnsetBlackboard key="h"/>'
        '<Script code="b := h"/></Sequence></BehaviorTree>',
    )
    tree.variables["h"] = 7
    assert tree.tick() is Status.SUCCESS
    assert (tree.variables["a"], tree.variables["b"]) == (2, 7)


def test_numbers_and_truth_values_are_read_as_the_engine_reads_them(world: World) -> None:
    """A script's `true` is valid for a port of booleans, its number for a port of texts."""
    nodes = (
        '<Sequence><Script code="flag := true; n := 3; x := 1.5"/>'
        f'<RunOnce then_skip="{{flag}}">{leaf("a", "S")}</RunOnce></Sequence>'
    )
    tree = world.tree(nodes)
    assert [tree.tick(), tree.tick()] == [Status.SUCCESS] * 2
    assert world.events() == ["start a"]
    word, sure = Port("word", str), Port("sure", bool)
    assert [word.read(value) for value in (3, 1.5, "t")] == ["3", "1.500000", "t"]
    assert [sure.read(value) for value in (1, 0.0, True, "false")] == [True, False, True, False]
    for port, value in ((sure, 2), (sure, 0.5), (word, True)):
        with pytest.raises(ValueError, match="expected"):
            port.read(value)
