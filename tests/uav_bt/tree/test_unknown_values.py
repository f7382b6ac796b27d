"""A node that reads a board key without a fresh value fails; the mission goes on."""

from __future__ import annotations

import logging

import pytest

from tests.worlds.trees import World, document, subtree
from uav_bt.board.blackboard import Key
from uav_bt.tree import Leaf, MissionTree, NodeRegistry, Port, Status, parse_tree
from uav_bt.types import Hover

SHARE = Key("share", float, "share of red in the picture", max_age_s=1.0)
WAIT = Key("wait_ms", int, "how long", unit="ms")
UNKNOWN = "@share &gt; 0.5"


class Detect(Leaf):
    """Declares the keys; the test writes them."""

    writes = (SHARE, WAIT)

    def update(self) -> Status:
        return Status.SUCCESS


class Fly(Leaf):
    """Proposes a movement, then reads its port."""

    moves = True
    ports = (Port("speed_mps", float, default=1.0, doc="m/s"),)
    ended: tuple[Status, ...] = ()

    def update(self) -> Status:
        self.propose(Hover())
        self.port_value("speed_mps")
        return Status.RUNNING

    def terminate(self, new_status: Status) -> None:
        self.ended = (*self.ended, new_status)


REGISTRY = NodeRegistry([Detect, Fly])


def tree_of(world: World, body: str) -> MissionTree:
    inner = subtree("In", '<ScriptCondition code="red &gt; 0"/>')
    text = document(f"<Sequence><Detect/>{body}</Sequence>", inner, tree_id="M")
    tree = parse_tree(text, REGISTRY)
    tree.setup(world.context)
    return tree


@pytest.mark.parametrize(
    "body",
    [
        f'<ScriptCondition code="{UNKNOWN}"/>',
        '<Script code="x := @share"/>',
        f'<AlwaysSuccess _skipIf="{UNKNOWN}"/>',
        f'<AlwaysSuccess _successIf="{UNKNOWN}"/>',
        f'<AlwaysSuccess _while="{UNKNOWN}"/>',
        '<AlwaysSuccess _onSuccess="x := @share"/>',
        f'<Precondition if="{UNKNOWN}" else="SUCCESS"><AlwaysSuccess/></Precondition>',
        '<Timeout msec="{@wait_ms}"><AlwaysSuccess/></Timeout>',
        '<SetBlackboard value="{@share}" output_key="x"/>',
        '<Fly speed_mps="{@share}"/>',
        '<SubTree ID="In" red="{@share}"/>',
    ],
)
def test_the_node_fails(world: World, body: str) -> None:
    assert tree_of(world, body).tick() is Status.FAILURE


def test_the_log_names_node_and_key_once(world: World, caplog: pytest.LogCaptureFixture) -> None:
    tree = tree_of(world, f'<ScriptCondition name="red" code="{UNKNOWN}"/>')
    with caplog.at_level(logging.WARNING):
        assert [tree.tick(), tree.tick()] == [Status.FAILURE] * 2
    (line,) = caplog.messages
    assert line.startswith("Warning: node 'M/Sequence/red' fails: script '@share > 0.5'")
    assert line.endswith("board key 'share' has no value yet")


def test_a_running_leaf_ends_with_failure_and_its_proposal_is_taken_back(world: World) -> None:
    tree = tree_of(world, '<Fly speed_mps="{@share}"/>')
    _, leaf = tree.leaves()
    assert isinstance(leaf, Fly)
    world.board.write(SHARE, 0.7)
    assert tree.tick() is Status.RUNNING
    world.clock.advance(2.0)
    world.context.proposals.clear()
    assert tree.tick() is Status.FAILURE
    assert leaf.ended == (Status.FAILURE,)
    assert world.context.proposals.movement is None


def test_a_guard_that_becomes_unknown_halts_what_runs(world: World) -> None:
    tree = tree_of(world, f'<Sequence _while="{UNKNOWN}"><Fly/></Sequence>')
    _, leaf = tree.leaves()
    assert isinstance(leaf, Fly)
    world.board.write(SHARE, 0.7)
    assert tree.tick() is Status.RUNNING
    world.clock.advance(2.0)
    assert tree.tick() is Status.FAILURE
    assert leaf.ended == (Status.IDLE,)


def test_a_halt_goes_on_where_its_script_reads_an_unknown_key(world: World) -> None:
    tree = tree_of(world, '<Fly _onHalted="x := @share"/>')
    assert tree.tick() is Status.RUNNING
    tree.halt()
    assert "x" not in tree.variables
