"""Plans of campaigns, and their folders: no stored flight is lost, wrong lines are recognized."""

from __future__ import annotations

import errno
import json
import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from tests.uav_bt.campaign.campaign_world import jsonl, keep, line, plan
from uav_bt.app.options import FlightOptions
from uav_bt.campaign.plan import CampaignPlan, PlannedFile
from uav_bt.campaign.store import CampaignStore, read_flights, read_plan
from uav_bt.errors import FileError, InputError
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
        ({"trees": ()}, "needs at least one tree"),
        ({"scenes": ()}, "needs at least one scene"),
    ],
)
def test_what_is_no_campaign_is_refused(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        plan(**changes)


# --- the folder -----------------------------------------------------------------------------------


def test_a_kept_flight_is_there_when_the_folder_is_opened_again(tmp_path: Path) -> None:
    folder = tmp_path / "new" / "folder"
    keep(folder, line(0))
    assert keep(folder, line(1), of=plan(flights=9)).kept == (line(0),)
    assert keep(folder, of=plan(flights=9)).kept == (line(0), line(1))
    read, runs = read_plan(folder)
    assert (read.flights, runs) == (9, [{"code": "abc"}] * 3)


@pytest.mark.parametrize("cut", range(1, len(json.dumps(line(1))) + 1, 7))
def test_a_line_cut_anywhere_is_taken_away_and_the_rest_stays(tmp_path: Path, cut: int) -> None:
    keep(tmp_path, line(0), line(1))
    path = tmp_path / "flights.jsonl"
    whole = path.read_bytes()
    path.write_bytes(whole[:-cut])
    store = keep(tmp_path, line(1))
    assert store.repaired
    assert store.kept == (line(0),)
    assert path.read_bytes() == whole


def test_a_full_disk_leaves_no_half_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(_file: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with CampaignStore.opened(tmp_path, plan(), {}) as store:
        store.keep(line(0))
        with monkeypatch.context() as disk:
            disk.setattr(os, "fsync", full)
            with pytest.raises(FileError, match="No space left on device; all flights before"):
                store.keep(line(1))
        store.keep(line(2))
    assert keep(tmp_path).kept == (line(0), line(2))


def test_another_plan_is_refused_and_nothing_is_touched(tmp_path: Path) -> None:
    keep(tmp_path, line(0))
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    with pytest.raises(
        InputError, match=r"holds another campaign.*\n  profile: was lab, now ideal"
    ):
        keep(tmp_path, of=plan(profile="ideal"))
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_a_campaign_without_a_flight_may_become_another(tmp_path: Path) -> None:
    """A command that was refused before any flight must not block the corrected one."""
    keep(tmp_path, of=plan(profile="harsh"))
    assert keep(tmp_path, line(0), of=plan(profile="ideal")).kept == ()
    found, runs = read_plan(tmp_path)
    assert found.options.profile == "ideal"
    assert len(runs) == 1


def test_two_campaigns_do_not_write_to_one_folder(tmp_path: Path) -> None:
    with (
        CampaignStore.opened(tmp_path, plan(), {}),
        pytest.raises(FileError, match="another campaign is at work in this folder"),
    ):
        keep(tmp_path)
    keep(tmp_path, line(0))


def test_what_is_no_campaigns_folder_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "flights.jsonl").write_text("mine\n")
    with pytest.raises(FileError, match=r"flights without a plan \(campaign\.json\)"):
        keep(tmp_path)
    assert (tmp_path / "flights.jsonl").read_text() == "mine\n"
    with pytest.raises(FileError, match="cannot be written: File exists"):
        keep(tmp_path / "flights.jsonl")


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ('{"tree": "a', "no JSON: Invalid control character"),
        ("[" * 100_000, "nested deeper than 64"),
        ('{"seed": 1e999}', "1e999 is beyond a double's range"),
        (json.dumps(line(duration_s=float("nan"))), "NaN is not JSON"),
        ("{}", "'tree': Field required"),
        (json.dumps(line(scene=3)), "'scene': Input should be a valid string, got 3"),
        (json.dumps(line() | {"seed": -1}), "'seed': Input should be greater than or equal to 0"),
        (json.dumps(line(outcome="fine")), "'outcome': Input should be 'success', 'collision'"),
        (json.dumps(line(tick_ms={"p50": 1.0})), "'tick_ms.p99': Field required"),
        (json.dumps(line(path=[[0.0, 1.0, 2.0]])), "'path.0.3': Field required"),
    ],
)
def test_what_is_no_flight_is_refused_with_its_line(text: str, why: str, tmp_path: Path) -> None:
    path = jsonl(tmp_path / "f.jsonl", line())
    path.write_text(f"{path.read_text()}\n{text}\n")
    with pytest.raises(FileError) as refused:
        read_flights(path)
    assert why in str(refused.value)
    assert str(refused.value).startswith(f"{path}:3: ")
    assert "delete this line; a campaign flies its flight again" in str(refused.value)


def test_of_a_flight_that_stands_there_twice_the_later_counts(tmp_path: Path) -> None:
    again = [line(0, reason="first"), line(1), line(0, reason="second", scene=None)]
    path = jsonl(tmp_path / "f.jsonl", *again, again[0] | {"reason": "third"})
    assert [flight["reason"] for flight in read_flights(path)] == ["landed", "second", "third"]
