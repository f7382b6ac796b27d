"""The event log: its events, and the failures of its assertions."""

from __future__ import annotations

import pytest

from uav_bt.errors import NodeFailedError, UnknownNameError
from uav_bt.testing import TreeBench, parse_tree
from uav_bt.tree import Leaf, NodeRegistry, Status


class Look(Leaf):
    """Looks."""

    def update(self) -> Status:
        raise ZeroDivisionError("blind")


class Fly(Leaf):
    """Flies."""

    update = Look.update


class Clear(Leaf):
    """Reports whether the path is clear."""

    condition = True


REGISTRY = NodeRegistry([Look, Fly, Clear])


def bench_of(body: str, **mocks: str) -> TreeBench:
    text = f'<root BTCPP_format="4"><BehaviorTree ID="M">{body}</BehaviorTree></root>'
    return parse_tree(text, REGISTRY, mocks=mocks)


def happened(bench: TreeBench) -> list[str]:
    return [f"{e.tick} {e.path.rpartition('/')[2]} {e.kind.value}" for e in bench.log.events]


REACTIVE = '<ReactiveSequence name="r"><Clear/><Fly/></ReactiveSequence>'


def test_every_node_is_followed_from_start_to_end() -> None:
    bench = bench_of(REACTIVE, Clear="SSF", Fly="R")
    for _ in range(3):
        bench.tick()
    assert happened(bench) == [
        *("1 r started", "1 Clear started", "1 Clear succeeded", "1 Fly started"),
        *("2 r ran", "2 Clear started", "2 Clear succeeded", "2 Fly ran"),
        *("3 r ran", "3 Clear started", "3 Clear failed", "3 Fly halted", "3 r failed"),
    ]


def test_conditions_forestall_and_skip() -> None:
    bench = bench_of('<Sequence><Fly _successIf="true"/><Look _skipIf="true"/></Sequence>')
    assert bench.tick() is Status.SUCCESS
    bench.log.assert_not_started("Fly")
    bench.log.assert_succeeded("Fly")
    bench.log.assert_skipped("Look", times=1, tick=1)


def test_an_exception_is_an_event_of_its_node() -> None:
    bench = bench_of("<Parallel><Fly/><Look/></Parallel>", Fly="R")
    with pytest.raises(NodeFailedError, match="'M/Parallel/Look' failed"):
        bench.tick()
    assert [e.path for e in bench.log.of("Look", "raised")] == ["M/Parallel/Look"]
    assert not bench.log.of("Parallel", "raised")
    bench.log.assert_order("Look raised", "Fly halted")


def test_a_failing_assertion_shows_the_log() -> None:
    bench = bench_of("<Fly/>", Fly="RS")
    bench.tick_until(Status.SUCCESS, max_ticks=2)
    with pytest.raises(AssertionError) as failure:
        bench.log.assert_halted("Fly")
    assert str(failure.value) == (
        "expected 'Fly' halted at least once, it was 0 times\n"
        " tick     time  event      node\n"
        "    1     0.00  started    M/Fly\n"
        "    2     0.10  ran        M/Fly\n"
        "    2     0.10  succeeded  M/Fly"
    )
    with pytest.raises(AssertionError, match="'Fly' started or ran in tick 2 3 times, it was 1"):
        bench.log.assert_ran("Fly", times=3, tick=2)
    with pytest.raises(AssertionError, match="'Fly' started never, it was 1 times"):
        bench.log.assert_not_started("Fly")


def test_misspelt_names_are_no_silent_pass() -> None:
    bench = bench_of("<Fly/>", Fly="R")
    with pytest.raises(UnknownNameError, match="unknown node 'Flu'; did you mean 'Fly'"):
        bench.log.assert_not_started("Flu")
    with pytest.raises(UnknownNameError, match="unknown event 'halts'; did you mean 'halted'"):
        bench.log.assert_order("Fly halts")


def test_nodes_that_never_began_are_listed() -> None:
    bench = bench_of('<Fallback name="f"><Clear/><Fly/><Look/></Fallback>', Clear="F", Fly="S")
    assert bench.log.never_ran() == ("M/f", "M/f/Clear", "M/f/Fly", "M/f/Look")
    bench.tick()
    assert bench.log.never_ran() == ("M/f/Look",)
