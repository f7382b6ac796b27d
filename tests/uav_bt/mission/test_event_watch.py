"""Events that no leaf reports."""

from __future__ import annotations

from typing import Any

from uav_bt.board.context import MissionContext
from uav_bt.mission.event_watch import EventWatch
from uav_bt.mission.safety import Override
from uav_bt.tree.branch_watch import BranchEnds
from uav_bt.tree.scripted import ScriptedLeaf
from uav_bt.types import FlyingState, Hover
from uav_bt.types.flight_results import EventKind

QUIET: dict[str, Any] = {
    "phase": "",
    "override": None,
    "reasons": (),
    "flying": FlyingState.FLYING,
    "ends": BranchEnds(),
}


def events_of(
    *ticks: dict[str, Any], context: MissionContext | None = None
) -> list[tuple[str, str]]:
    """Return kind and text of the events of ticks, each told by what differs from a quiet one."""
    context = context or MissionContext()
    watch = EventWatch(context)
    for tick in ticks:
        watch.update(**QUIET | tick)
    return [(event.kind, event.text) for event in context.notes.events]


def test_a_quiet_tick_has_no_event() -> None:
    assert events_of({}, {}, {}) == []


def test_each_phase_is_an_event_with_the_leaf_that_moves() -> None:
    context = MissionContext()
    context.proposals.propose("M/Explore", Hover())
    explore, search = {"phase": "explore"}, {"phase": "search"}
    assert events_of({}, explore, explore, search, context=context) == [
        (EventKind.PHASE, "explore"),
        (EventKind.PHASE, "search"),
    ]
    assert context.notes.events[0].node == "M/Explore"


def test_overrides_begin_and_end() -> None:
    stale = {"override": Override.STALE_FRAME, "reasons": ("frame: black",)}
    link = {"override": Override.LINK}
    assert events_of({}, stale, stale, link, {}) == [
        (EventKind.OVERRIDE, "stale frame: frame: black"),
        (EventKind.OVERRIDE_OVER, "stale frame"),
        (EventKind.OVERRIDE, "link lost"),
        (EventKind.OVERRIDE_OVER, "link lost"),
    ]


def test_a_pilot_takes_over_and_hands_back() -> None:
    manual = {"override": Override.MANUAL}
    assert events_of(manual, manual, {}) == [
        (EventKind.PILOT, "a person took over"),
        (EventKind.PILOT_OVER, "the mission goes on"),
    ]


def test_the_landing_is_an_event_and_standing_is_none() -> None:
    ground, air = {"flying": FlyingState.LANDED}, {"flying": FlyingState.HOVERING}
    assert events_of(ground, air, ground, ground, air, ground) == [
        (EventKind.LANDED, "the drone landed"),
        (EventKind.LANDED, "the drone landed"),
    ]


def test_failed_branches_and_the_end_have_path_and_reason() -> None:
    context = MissionContext()
    turn, land = ScriptedLeaf("Turn"), ScriptedLeaf("Land")
    turn.path, land.path = "M/s/Turn", "M/Land"
    turn.feedback_message = "kept from turning"
    assert events_of(
        {"ends": BranchEnds(failed=(turn,))},
        {"ends": BranchEnds(ended=land, succeeded=True)},
        {"ends": BranchEnds(ended=turn)},
        context=context,
    ) == [
        (EventKind.FAILED, "Turn: kept from turning"),
        (EventKind.ENDED, "the tree succeeded at Land"),
        (EventKind.ENDED, "the tree failed at Turn: kept from turning"),
    ]
    assert [event.node for event in context.notes.events] == ["M/s/Turn", "M/Land", "M/s/Turn"]


def test_the_last_failure_is_kept_unless_the_tree_fails_with_a_reason() -> None:
    watch = EventWatch(MissionContext())
    lost, landing = ScriptedLeaf("lost"), ScriptedLeaf("landing")
    lost.feedback_message = "no way"
    watch.update(**QUIET | {"ends": BranchEnds(failed=(lost,))})
    watch.update(**QUIET | {"ends": BranchEnds(ended=landing)})
    assert watch.failure == "lost: no way"

    landing.feedback_message = "no ground"
    watch.update(**QUIET | {"ends": BranchEnds(ended=landing)})
    assert watch.failure == "landing: no ground"
