"""Which node made a running branch fail, and at which one a tree ended."""

from __future__ import annotations

import pytest

from uav_bt.board import ELAPSED
from uav_bt.testing import parse_tree
from uav_bt.tree.branch_watch import BranchEnds, BranchWatch
from uav_bt.tree.status import Status

ROOT = '<root BTCPP_format="4"><BehaviorTree ID="M">{}</BehaviorTree></root>'
GUARDED = """
<Fallback name="fly">
  <ReactiveSequence name="guarded">
    <Hovering/>
    <Sequence name="survey"><Turn degrees="90"/><HoverFor/></Sequence>
  </ReactiveSequence>
  <EmergencyLand/>
</Fallback>"""


def ends_of(text: str, mocks: dict[str, str], ticks: int) -> list[tuple[list[str], str | None]]:
    """Return for each tick the causes of failures and the node at which the tree ended."""
    bench = parse_tree(ROOT.format(text), mocks=mocks)
    watch, found = BranchWatch(bench.tree), []
    for _ in range(ticks):
        bench.tick()
        ends = watch.take()
        found.append(
            ([node.path for node in ends.failed], None if ends.ended is None else ends.ended.path)
        )
    return found


def test_a_condition_that_ends_a_running_branch_is_the_cause() -> None:
    mocks = {"Hovering": "SSF", "Turn": "R", "HoverFor": "S", "EmergencyLand": "RF"}
    assert ends_of(GUARDED, mocks, 4) == [
        ([], None),
        ([], None),
        (["M/fly/guarded/Hovering"], None),
        ([], "M/fly/EmergencyLand"),
    ]


def test_a_leaf_that_fails_is_the_cause_once_for_all_branches_above() -> None:
    mocks = {"Hovering": "S", "Turn": "RF", "HoverFor": "S", "EmergencyLand": "RR"}
    assert ends_of(GUARDED, mocks, 2)[1] == (["M/fly/guarded/survey/Turn"], None)


def test_a_branch_that_fails_in_its_first_tick_is_no_event() -> None:
    """A fallback whose first child is a condition asks it in every tick."""
    tree = '<ReactiveFallback name="f"><Hovering/><HoverFor/></ReactiveFallback>'
    assert ends_of(tree, {"Hovering": "F", "HoverFor": "R"}, 3) == [([], None)] * 3


def test_a_decorator_that_fails_by_itself_is_the_cause() -> None:
    tree = (
        '<Fallback name="f"><Timeout msec="100"><HoverFor/></Timeout><Turn degrees="9"/></Fallback>'
    )
    found = ends_of(tree, {"HoverFor": "R", "Turn": "R"}, 4)
    assert [causes for causes, _ in found if causes] == [["M/f/Timeout"]]


def test_a_leaf_that_is_skipped_while_it_runs_did_not_fail() -> None:
    tree = '<Fallback name="f"><HoverFor _while="@elapsed_s &lt; 1"/><Turn degrees="9"/></Fallback>'
    bench = parse_tree(ROOT.format(tree), mocks={"HoverFor": "R", "Turn": "R"})
    watch = BranchWatch(bench.tree)
    bench.board[ELAPSED] = 0.5
    bench.tick()
    assert watch.take() == BranchEnds()
    bench.board[ELAPSED] = 1.5
    bench.tick()
    bench.log.assert_halted("HoverFor", times=1)
    assert watch.take() == BranchEnds()


@pytest.mark.parametrize(("answer", "succeeded"), [("RS", True), ("RF", False)])
def test_the_last_leaf_ends_the_tree(answer: str, *, succeeded: bool) -> None:
    bench = parse_tree(
        ROOT.format('<Sequence name="s"><Turn degrees="9"/><HelipadCenter/></Sequence>'),
        mocks={"Turn": "S", "HelipadCenter": answer},
    )
    watch = BranchWatch(bench.tree)
    bench.tick()
    watch.take()
    assert bench.tick() is (Status.SUCCESS if succeeded else Status.FAILURE)
    ends = watch.take()
    assert ends.ended is not None
    assert (ends.ended.path, ends.succeeded, ends.failed) == ("M/s/HelipadCenter", succeeded, ())
