"""Plans: their flights, the identity of a campaign, and their files."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from tests.uav_bt.campaign.campaign_world import plan
from uav_bt.app.options import FlightOptions
from uav_bt.campaign.plan import SHARED, CampaignPlan, FlightTask, PlannedFile, PlannedTree
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


def test_plans_and_tasks_survive_being_written() -> None:
    wanted = plan(policies={"Explore": "x"}, weights={"w": "2" * 64}, versions={"python": "3"})
    assert CampaignPlan.from_json(json.loads(json.dumps(wanted.to_json()))) == wanted
    task = next(wanted.tasks())
    assert FlightTask.from_json(json.loads(json.dumps(task.to_json()))) == task


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (
            {"trees": (PlannedTree(name="one.xml", path="one.xml", sha256="9" * 64),)},
            "'one.xml' has changed",
        ),
        (
            {"trees": (PlannedTree(name="two.xml", path="two.xml", sha256="0" * 64),)},
            "'two.xml' is new",
        ),
        (
            {"scenes": (PlannedFile(name="lab", path="lab", sha256="9" * 64),)},
            "scene: 'lab' has changed",
        ),
        ({"flights": 1}, "flights: 2 were planned, now 1"),
        ({"seed_from": 1}, "seed_from: was 0, now 1"),
        ({"profile": "harsh"}, "profile: was lab, now harsh"),
        ({"image_size_px": (320, 180)}, "image_size_px: was [640, 360], now [320, 180]"),
        ({"exact_masks": True}, "exact_masks: was False, now True"),
        ({"movers": 1}, "movers: was 0, now 1"),
        ({"policies": {"Explore": "x"}}, "policies: 'Explore' is new"),
        ({"weights": {"unet.onnx": "3" * 64}}, "weights: 'unet.onnx' is new"),
        ({"versions": {"numpy": "2"}}, "versions: 'numpy' is new"),
    ],
)
def test_what_changes_flights_makes_it_another_campaign(change: dict[str, Any], told: str) -> None:
    before = plan()
    shared = {name: value for name, value in change.items() if name in SHARED}
    others = {name: value for name, value in change.items() if name not in SHARED}
    now = replace(before, options=replace(before.options, **shared), **others)
    assert told in "\n".join(now.differences(before))


def test_changed_weights_and_versions_are_reported_with_both() -> None:
    before = plan(weights={"w": "a" * 64}, versions={"numpy": "1.0"})
    now = replace(before, weights={"w": "b" * 64}, versions={"numpy": "2.0"})
    assert now.differences(before) == [
        "weights: 'w' has changed (SHA-256 aaaaaaaa, now bbbbbbbb)",
        "versions: 'numpy' was 1.0, now 2.0",
    ]


@pytest.mark.parametrize("change", [{"flights": 9}, {"timeout_s": 5.0}, {"record": True}])
def test_what_changes_no_flight_goes_on(change: dict[str, Any]) -> None:
    assert replace(plan(), **change).differences(plan()) == []


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
        flown = FlightTask.from_json(json.loads(json.dumps(task.to_json()))).flight_options()
        assert flown == replace(before.options, scene=task.scene_path, seed=task.seed)


def test_settings_that_are_constants_today_do_not_cost_a_plan() -> None:
    before = plan()
    values = json.loads(json.dumps(before.to_json()))
    values["judge"]["patience_s"] = 60.0
    assert CampaignPlan.from_json(values) == before


def test_options_that_a_campaign_does_not_keep_are_refused() -> None:
    before = plan()
    with pytest.raises(
        InputError, match="a campaign takes no rehearse, only tree_id, tree_folders"
    ):
        replace(before, options=FlightOptions(rehearse=True))


def test_a_real_drone_is_refused() -> None:
    with pytest.raises(InputError, match="drone 'anafi' cannot fly a campaign, only simulated"):
        replace(plan(), options=FlightOptions(drone="anafi"))


def test_the_drone_and_the_faults_of_a_plan_must_be_the_same_when_it_goes_on() -> None:
    before = plan()
    options = FlightOptions(drone="plain", faults=["random"])
    assert replace(before, options=options).differences(before) == [
        "drone: was twin, now plain",
        "faults: was [], now ['random']",
    ]


def test_two_trees_of_one_name_are_refused() -> None:
    with pytest.raises(InputError, match=r"two trees are called 'a\.xml'"):
        plan(trees=("a.xml", "a.xml"))


@pytest.mark.parametrize("what", ["trees", "scenes"])
def test_a_campaign_of_nothing_is_refused(what: str) -> None:
    with pytest.raises(InputError, match=f"needs at least one {what[:-1]}"):
        plan(**{what: ()})


@pytest.mark.parametrize(
    "values", [{}, {"image_size_px": 3}, {"image_size_px": [1, 2]}, {**plan().to_json(), "x": 1}]
)
def test_values_of_no_plan_are_refused(values: dict[str, Any]) -> None:
    with pytest.raises(InputError, match="not a campaign's plan"):
        CampaignPlan.from_json(values)
