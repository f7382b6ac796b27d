"""Shipped missions in the kit: reactions to leaves that succeed, fail or keep running."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from tests.worlds.tables import cases
from uav_bt.testing import load_tree
from uav_bt.tree import Status

TREES = Path(__file__).parents[3] / "trees"
CASES = cases("shipped_missions")


@pytest.mark.parametrize("case", CASES.values(), ids=CASES)
def test_a_mission_reacts_to_what_its_leaves_answer(case: dict[str, Any]) -> None:
    bench = load_tree(TREES / f"{case['mission']}.xml", mocks=case["mocks"])
    if "until" in case:
        ticks = bench.tick_until(case["until"], max_ticks=case["ticks"])
        bench.log.assert_started("Segment", times=ticks)
    else:
        for _ in range(case["ticks"]):
            bench.tick()
    bench.log.assert_order(*case.get("order", ()))
    for node, times in case.get("started", {}).items():
        bench.log.assert_started(node, times=times)
    for leaf in case.get("looks_down", ()):
        assert bench.tree.find(leaf).port_value("looks_down") is True


def test_exploring_ends_after_its_time_in_the_middle_of_a_step() -> None:
    """It turns away after a blocked step; after 90 s it returns, during any movement."""
    sees = {"Segment": "S", "FindMark": "S", "TrackMotion": "S", "MapSite": "S"}
    flies = {"TakeOff": "S", "Explore": "(RRF)", "Avoid": "(RS)", "HelipadCenter": "S", "Land": "S"}
    lands = {"ReturnToBase": "RS", "EmergencyLand": "F"}
    path = TREES / "explore_and_land_segmentation.xml"
    bench = load_tree(path, mocks={**sees, **flies, **lands}, tick_s=1.0)
    bench.tick_until(Status.SUCCESS, max_ticks=100)
    (start, *_), (home, *_) = (
        bench.log.of(node, "started") for node in ("ExploreFor", "ReturnToBase")
    )
    assert home.time_s - start.time_s == pytest.approx(90.0)
    bench.log.assert_order(
        *("Explore failed", "Avoid started", "Avoid succeeded", "Explore started"),
        *("step_or_turn halted", "Timeout failed", "explore_for succeeded", "Land started"),
    )
    bench.log.assert_not_started("EmergencyLand")
