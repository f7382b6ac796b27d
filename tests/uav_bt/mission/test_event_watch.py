"""Events that no leaf reports."""

from __future__ import annotations

from typing import Any

import pytest

from uav_bt.board.context import MissionContext
from uav_bt.mission.safety import Override
from uav_bt.mission.tick import EventWatch
from uav_bt.tree.scripted import ScriptedLeaf
from uav_bt.tree.watches import BranchEnds
from uav_bt.types.flight_results import EventKind

QUIET: dict[str, Any] = {
    "override": None,
    "refused": (),
    "landed": False,
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


STALE = {"override": Override.STALE_FRAME, "refused": ("frame: black",)}
LINK, MANUAL = {"override": Override.LINK}, {"override": Override.MANUAL}
GROUND, AIR = {"landed": True}, {"landed": False}


@pytest.mark.parametrize(
    ("ticks", "events"),
    [
        (
            ({}, STALE, STALE, LINK, {}),
            [
                (EventKind.OVERRIDE, "stale frame: frame: black"),
                (EventKind.OVERRIDE_OVER, "stale frame"),
                (EventKind.OVERRIDE, "link lost"),
                (EventKind.OVERRIDE_OVER, "link lost"),
            ],
        ),
        ((GROUND, AIR, GROUND, GROUND, AIR, GROUND), [(EventKind.LANDED, "the drone landed")] * 2),
    ],
)
def test_a_change_is_an_event(
    ticks: tuple[dict[str, Any], ...], events: list[tuple[str, str]]
) -> None:
    assert events_of(*ticks) == events


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
