"""Events that no leaf reports."""

from __future__ import annotations

from typing import Any

import pytest

from tests.worlds.tables import cases
from uav_bt.board.context import MissionContext
from uav_bt.mission.tick import EventWatch
from uav_bt.tree.scripted import ScriptedLeaf
from uav_bt.tree.watches import BranchEnds

QUIET: dict[str, Any] = {"override": None, "refused": (), "landed": False, "ends": BranchEnds()}


@pytest.mark.parametrize(("ticks", "events"), cases("mission")["events"])
def test_a_change_is_an_event(ticks: list[dict[str, Any]], events: list[list[str]]) -> None:
    context = MissionContext()
    watch = EventWatch(context)
    for tick in ticks:
        watch.update(**QUIET | tick)
    assert [[event.kind.value, event.text] for event in context.notes.events] == events


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
