"""Plans: their flights, the identity of a campaign, and their files."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from tests.uav_bt.campaign.campaign_world import plan
from uav_bt.app.options import FlightOptions
from uav_bt.campaign.plan import CampaignPlan, PlannedFile
from uav_bt.errors import InputError
from uav_bt.tree.loading.lookup import TreeFolders


def test_every_tree_flies_in_every_scene_with_every_seed() -> None:
    wanted = plan(trees=("a.xml", "b.xml"), scenes=("x", "y"), flights=3, seed_from=5)
    keys = [task.key for task in wanted.tasks()]
    assert len(keys) == len(set(keys)) == len(wanted) == 12
    assert {seed for _, _, seed in keys} == {5, 6, 7}
    assert {(tree, scene) for tree, scene, _ in keys[:4]} == {
        *(("a.xml", "x"), ("a.xml", "y"), ("b.xml", "x"), ("b.xml", "y"))
    }, "a beginning of the campaign must not favour a tree or a scene"


CHANGED = {"path": "one", "sha256": "9" * 64}


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (
            {"trees": (PlannedFile(name="one.xml", **CHANGED),)},
            "trees one.xml sha256 has changed (SHA-256 00000000, now 99999999)",
        ),
        ({"trees": (PlannedFile(name="two", **CHANGED),)}, "trees two sha256: was none, now 9"),
        ({"scenes": (PlannedFile(name="lab", **CHANGED),)}, "scenes lab sha256 has changed"),
        ({"flights": 1}, "flights: 2 were planned, now 1"),
        ({"seed_from": 1}, "seed_from: was 0, now 1"),
        ({"weights": {"unet.onnx": "3" * 64}}, "weights unet.onnx: was none, now 3"),
        ({"versions": {"numpy": "2"}}, "versions numpy: was none, now 2"),
        ({"options": FlightOptions(profile="harsh")}, "profile: was lab, now harsh"),
        (
            {"options": FlightOptions(image_size_px=(320, 180))},
            "image_size_px: was [640, 360], now [320, 180]",
        ),
        ({"options": FlightOptions(exact_masks=True)}, "exact_masks: was none, now True"),
        ({"options": FlightOptions(faults=["random"])}, "faults: was none, now ['random']"),
        ({"options": FlightOptions(policies={"Go": "x"})}, "policies Go: was none, now x"),
    ],
)
def test_what_changes_flights_makes_it_another_campaign(change: dict[str, Any], told: str) -> None:
    assert told in "\n".join(replace(plan(), **change).differences(plan()))


@pytest.mark.parametrize("change", [{"flights": 9}, {"timeout_s": 5.0}, {"record": True}])
def test_what_changes_no_flight_goes_on(change: dict[str, Any]) -> None:
    assert plan(**change).differences(plan()) == []


def test_a_plan_comes_back_from_json_with_the_options_of_its_flights() -> None:
    before = plan(
        profile="harsh",
        image_size_px=(320, 180),
        exact_masks=True,
        movers=2,
        tree_id="Main",
        tree_folders=TreeFolders(trees=[Path("parts").absolute()]),
        policies={"Explore": "corridor"},
        record_quality="small",
    )
    assert CampaignPlan.from_json(json.loads(json.dumps(before.to_json()))) == before
    for task in before.tasks():
        assert task.options == replace(before.options, scene="lab", seed=task.key[2])


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"options": FlightOptions(rehearse=True)}, "a campaign takes no rehearse, only tree_id"),
        ({"options": FlightOptions(drone="anafi")}, "drone 'anafi' cannot fly a campaign, only"),
        ({"trees": ("one.xml", "one.xml")}, r"two trees are called 'one\.xml'"),
        ({"trees": ()}, "needs at least one tree"),
        ({"scenes": ()}, "needs at least one scene"),
        ({"flights": 0}, "flights must be a positive whole number, got 0"),
    ],
)
def test_what_is_no_campaign_is_refused(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        plan(**changes)
