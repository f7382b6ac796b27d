"""Shipped missions in the kit: reactions to leaves that succeed, fail or keep running."""

from __future__ import annotations

from pathlib import Path

import pytest

from uav_bt.testing import TreeBench, load_tree
from uav_bt.tree import Status

TREES = Path(__file__).parents[3] / "trees"
LOOKS = {"Segment": "S", "FindMark": "S"}
SEES = {**LOOKS, "TrackMotion": "S", "MapSite": "S"}


def land_only(**mocks: str) -> TreeBench:
    flies = {"TakeOff": "RS", "ReturnToBase": "(RS)", "HelipadCenter": "S", "Land": "RS"}
    return load_tree(
        TREES / "land_only.xml", mocks={**SEES, **flies, "EmergencyLand": "RF", **mocks}
    )


def test_landing_follows_finding_the_pad() -> None:
    bench = land_only()
    ticks = bench.tick_until(Status.SUCCESS, max_ticks=20)
    bench.log.assert_order(
        "TakeOff succeeded", "ReturnToBase succeeded", "HelipadCenter succeeded", "Land started"
    )
    bench.log.assert_started("Segment", times=ticks)
    bench.log.assert_not_started("EmergencyLand")


@pytest.mark.parametrize(("centring", "tries"), [("FFS", 3), ("FFFFS", 5)])
def test_a_pad_that_is_lost_is_searched_for_again(centring: str, tries: int) -> None:
    bench = land_only(HelipadCenter=centring)
    bench.tick_until(Status.SUCCESS, max_ticks=40)
    bench.log.assert_started("ReturnToBase", times=tries)
    bench.log.assert_not_started("EmergencyLand")


@pytest.mark.parametrize("mocks", [{"HelipadCenter": "F"}, {"TakeOff": "RF"}])
def test_what_fails_for_good_ends_in_an_emergency_landing(mocks: dict[str, str]) -> None:
    bench = land_only(**mocks)
    bench.tick_until(Status.FAILURE, max_ticks=40)
    bench.log.assert_order("return_and_land failed", "EmergencyLand started", "mission failed")


def test_exploring_ends_after_its_time_in_the_middle_of_a_step() -> None:
    """It turns away after a blocked step; after 90 s it returns, during any movement."""
    flies = {"TakeOff": "S", "Explore": "(RRF)", "Avoid": "(RS)", "HelipadCenter": "S", "Land": "S"}
    bench = load_tree(
        TREES / "explore_and_land_segmentation.xml",
        mocks={**SEES, **flies, "ReturnToBase": "RS", "EmergencyLand": "F"},
        tick_s=1.0,
    )
    bench.tick_until(Status.SUCCESS, max_ticks=100)
    (start, *_), (home, *_) = (
        bench.log.of(node, "started") for node in ("ExploreFor", "ReturnToBase")
    )
    assert home.time_s - start.time_s == pytest.approx(90.0)
    bench.log.assert_order(
        "Explore failed",
        "Avoid started",
        "Avoid succeeded",
        "Explore started",
        "step_or_turn halted",
        "Timeout failed",
        "explore_for succeeded",
        "Land started",
    )
    bench.log.assert_not_started("EmergencyLand")


@pytest.mark.parametrize(
    "mission",
    [
        "explore_and_land_depth",
        "explore_and_land_segmentation",
        "survey_and_land",
        "survey_any_room",
    ],
)
def test_near_the_edge_the_camera_is_lowered_to_the_ground(mission: str) -> None:
    bench = load_tree(TREES / f"{mission}.xml", mocks={"*": "S", "Explore": "RRF", "Avoid": "R"})
    for _ in range(6):
        bench.tick()
    bench.log.assert_order("Explore failed", "Avoid started")
    for leaf in ("Explore", "Avoid"):
        assert bench.tree.find(leaf).port_value("looks_down") is True


def survey_any_room(senses: str, view: str) -> TreeBench:
    mocks = {"*": "S", "TakeOff": "RRS", "Explore": "R", "Turn": "(RRS)", "EmergencyLand": "R"}
    conditions = {"senses_agree": senses, "this_view_agrees": view}
    return load_tree(TREES / "survey_any_room.xml", mocks={**mocks, **conditions})


@pytest.mark.parametrize(("view", "turns", "explores"), [("S", 0, 1), ("SSFFFFS", 2, 2)])
def test_nothing_is_flown_by_a_view_that_contradicts_itself(
    view: str, turns: int, explores: int
) -> None:
    bench = survey_any_room("S", view)
    for _ in range(12):
        bench.tick()
    bench.log.assert_started("Turn", times=turns)
    bench.log.assert_started("Explore", times=explores)


@pytest.mark.parametrize("senses", ["SF", "SSSSSF"])
def test_senses_that_disagree_for_long_end_the_survey(senses: str) -> None:
    bench = survey_any_room(senses, "S")
    for _ in range(8):
        bench.tick()
    bench.log.assert_order("senses_agree failed", "EmergencyLand started")
    bench.log.assert_not_started("GoTo")
