"""Behaviour of control nodes and decorators; recorded traces test the rest."""

from __future__ import annotations

import pytest

from tests.conformance import Scripted
from tests.worlds.trees import World, leaf
from uav_bt.errors import InputError, MissionError, NodeFailedError, TreeError
from uav_bt.tree import MissionTree, Status
from uav_bt.tree.nodes import Inverter, Parallel, Repeat, Sequence, SubTree


def test_sequence_goes_on_where_it_was(world: World) -> None:
    """A running child is ticked again, earlier children are not."""
    tree = world.tree(f"<Sequence>{leaf('a', 'S')}{leaf('b', 'RS')}</Sequence>")
    assert tree.tick() is Status.RUNNING
    assert world.events() == ["start a", "start b"]
    assert tree.tick() is Status.SUCCESS
    assert world.events() == ["running b"]


def test_reactive_sequence_asks_again_and_halts(world: World) -> None:
    """A condition that becomes false halts the action behind it."""
    tree = world.tree(
        f"<ReactiveSequence>{leaf('safe', 'SSF')}{leaf('act', 'R')}</ReactiveSequence>"
    )
    assert [tree.tick(), tree.tick(), tree.tick()] == [
        Status.RUNNING,
        Status.RUNNING,
        Status.FAILURE,
    ]
    assert world.events()[-2:] == ["start safe", "halt act"]


@pytest.mark.parametrize(
    ("body", "answers"),
    [
        (f"<Fallback>{leaf('a', 'F')}{leaf('b', 'RS')}</Fallback>", "RSS"),
        (f"<Sequence>{leaf('a', 'K')}{leaf('b', 'K')}</Sequence>", "KK"),
        (f"<Inverter>{leaf('a', 'RSF')}</Inverter>", "RFS"),
        (f"<ForceSuccess>{leaf('a', 'RFS')}</ForceSuccess>", "RSS"),
        (f"<ForceFailure>{leaf('a', 'RFS')}</ForceFailure>", "RFF"),
        (f"<KeepRunningUntilFailure>{leaf('a', 'SSF')}</KeepRunningUntilFailure>", "RRF"),
        (f'<Repeat num_cycles="2">{leaf("a", "SSF")}</Repeat>', "RSF"),
        (f'<RetryUntilSuccessful num_attempts="2">{leaf("a", "F")}</RetryUntilSuccessful>', "RFR"),
        (f"<RunOnce>{leaf('a', 'RS')}</RunOnce>", "RSKK"),
        (f'<RunOnce then_skip="false">{leaf("a", "F")}</RunOnce>', "FFF"),
        (f"<SequenceWithMemory>{leaf('a', 'S')}{leaf('b', 'FS')}</SequenceWithMemory>", "RFS"),
        (f"<Parallel>{leaf('a', 'RS')}{leaf('b', 'S')}</Parallel>", "RS"),
        (f'<Parallel success_count="1">{leaf("a", "R")}{leaf("b", "RS")}</Parallel>', "RS"),
        ("<AlwaysSuccess/>", "SS"),
        ("<AlwaysFailure/>", "FF"),
    ],
)
def test_answers(world: World, body: str, answers: str) -> None:
    """Each node answers according to its description in each tick."""
    assert world.run(body, len(answers)) == answers


def test_timeout_halts_its_child(world: World) -> None:
    """A child that runs at the deadline is halted once; the node fails and can restart."""
    tree = world.tree(f'<Timeout msec="300">{leaf("a", "R")}</Timeout>')
    answers = []
    for _ in range(5):
        answers.append(tree.tick())
        world.clock.advance(0.1)
    assert answers == [Status.RUNNING] * 3 + [Status.FAILURE, Status.RUNNING]
    assert world.events() == ["start a", "running a", "running a", "halt a", "start a"]


def test_timeout_zero_is_no_limit(world: World) -> None:
    """`msec="0"` means no timeout."""
    tree = world.tree(f'<Timeout msec="0">{leaf("a", "R")}</Timeout>')
    for _ in range(4):
        assert tree.tick() is Status.RUNNING
        world.clock.advance(1000.0)


def test_delay_waits_on_the_mission_clock(world: World) -> None:
    """The child starts after the time has passed, independent of the number of ticks."""
    tree = world.tree(f'<Delay delay_msec="500">{leaf("a", "S")}</Delay>')
    assert [tree.tick() for _ in range(3)] == [Status.RUNNING] * 3
    assert world.events() == []
    world.clock.advance(0.5)
    assert tree.tick() is Status.SUCCESS
    assert world.events() == ["start a"]


def test_halted_timers_start_over(world: World) -> None:
    """A halt resets the waiting time."""
    tree = world.tree('<Sleep msec="200"/>')
    tree.tick()
    world.clock.advance(0.15)
    tree.halt()
    assert tree.tick() is Status.RUNNING
    world.clock.advance(0.15)
    assert tree.tick() is Status.RUNNING
    world.clock.advance(0.05)
    assert tree.tick() is Status.SUCCESS


@pytest.mark.parametrize(
    ("before", "parallel"),
    [
        ("", '<Parallel success_count="3">'),
        ("", '<Parallel failure_count="3">'),
        ("", '<ParallelAll max_failures="3">'),
        ('<Script code="n := 3"/>', '<Parallel success_count="{n}">'),
        ('<SetBlackboard value="3" output_key="n"/>', '<ParallelAll max_failures="{n}">'),
    ],
)
def test_a_parallel_is_refused_that_counts_more_children_than_it_has(
    world: World, before: str, parallel: str
) -> None:
    end = "</Parallel>" if "<Parallel " in parallel else "</ParallelAll>"
    children = f"{leaf('a', 'R')}{leaf('b', 'R')}"
    with pytest.raises(TreeError, match="expected at most its 2 children, got 3"):
        world.tree(f"<Sequence>{before}{parallel}{children}{end}</Sequence>")


def test_a_parallel_raises_when_a_variable_counts_more_children_than_it_has(world: World) -> None:
    tree = world.tree(
        '<Sequence><Script code="n := 1; n := n + 2"/><Parallel success_count="{n}">'
        f"{leaf('a', 'R')}{leaf('b', 'R')}</Parallel></Sequence>"
    )
    with pytest.raises(NodeFailedError, match="must not exceed the 2 children") as error:
        tree.tick()
    assert isinstance(error.value.__cause__, MissionError)


def test_ports_can_follow_variables(world: World) -> None:
    """A port given as `{key}` is read at every tick."""
    tree = world.tree(f'<Repeat num_cycles="{{n}}">{leaf("a", "S")}</Repeat>')
    tree.variables["n"] = "2"
    assert [tree.tick(), tree.tick()] == [Status.RUNNING, Status.SUCCESS]
    tree.variables["n"] = 1
    assert tree.tick() is Status.SUCCESS


def test_subtree_shares_what_it_says(world: World) -> None:
    """An entry in braces is an outer variable, a plain one a constant; others are private."""
    inner = (
        '<BehaviorTree ID="Inner"><Sequence>'
        f'<Repeat num_cycles="{{n}}">{leaf("a", "S")}</Repeat>'
        f'<Repeat num_cycles="{{m}}">{leaf("b", "S")}</Repeat>'
        "</Sequence></BehaviorTree>"
    )
    tree = world.tree('<SubTree ID="Inner" n="{outer}" m="1"/>', inner)
    tree.variables["outer"] = 2
    tree.variables["m"] = 5
    assert [tree.tick(), tree.tick()] == [Status.RUNNING, Status.SUCCESS]
    assert world.events() == ["start a", "start a", "start b"]


def test_trees_are_composed_in_python_too(world: World) -> None:
    """Nodes with typed arguments form a tree without a file."""
    root = Sequence(
        "root",
        [
            Repeat("twice", Scripted("a", script="S"), num_cycles=2),
            Inverter(None, Scripted("b", script="F")),
            SubTree("inside", Scripted("c", script="{text}"), {"text": "S"}),
        ],
    )
    tree = MissionTree(root, name="Mission")
    tree.setup(world.context)
    assert [tree.tick(), tree.tick()] == [Status.RUNNING, Status.SUCCESS]
    assert [node.path for node in tree.leaves()] == [
        "Mission/root/twice/a",
        "Mission/root/Inverter/b",
        "Mission/root/inside/c",
    ]


def test_composing_checks_ports_and_children() -> None:
    """Mistakes that the loader refuses are refused in Python, too."""
    with pytest.raises(InputError, match="did you mean 'num_cycles'"):
        Repeat("r", Scripted("a", script="S"), num_cycle=2)
    with pytest.raises(TypeError, match=r"uav_bt\.tree node"):
        Parallel("p", [object()])  # type: ignore[list-item]
