"""Campaigns in a lab: its scenes, and its files in the plan."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.uav_bt.app.test_lab_flights import LAB, MARK, SCENE
from tests.uav_bt.campaign.test_planning import tree
from uav_bt.campaign import make_plan, plan_of
from uav_bt.campaign.plan import CampaignPlan, FlightTask
from uav_bt.campaign.store import CampaignStore
from uav_bt.errors import FileError, InputError
from uav_bt.lab.lab import Lab


@pytest.fixture
def hall(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A lab with two scenes in `labs/` of the working directory."""
    monkeypatch.chdir(tmp_path)
    folder = tmp_path / "labs" / "hall"
    (folder / "scenes").mkdir(parents=True)
    (folder / "camera.yaml").touch()
    (folder / "lab.yaml").write_text(f"{LAB}{MARK}camera: camera.yaml\n")
    for name in ("east", "west"):
        (folder / "scenes" / f"{name}.yaml").write_text(SCENE)
    tree(tmp_path / "hop.xml")
    return folder


def test_all_scenes_of_the_lab_are_flown_unless_some_are_named(hall: Path) -> None:
    plan = make_plan(["hop.xml"], flights=1, lab="hall")
    assert [scene.name for scene in plan.scenes] == ["east", "west"]
    assert plan.scenes[0].path == str(hall / "scenes" / "east.yaml")
    for words in (["we*"], ["west"]):
        named = make_plan(["hop.xml"], scenes=words, flights=1, lab="hall")
        assert [scene.name for scene in named.scenes] == ["west"]
    with pytest.raises(InputError, match="'val-a' belongs to the lab 'paper'"):
        make_plan(["hop.xml"], scenes=["val-a"], flights=1, lab="hall")
    paper = make_plan(["hop.xml"], flights=1, lab="paper")
    assert [scene.name for scene in paper.scenes] == ["val-a", "val-b"]


def test_the_plan_and_its_flights_keep_the_lab(
    hall: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plan = make_plan(["hop.xml"], flights=1, lab="hall")
    values = json.loads(json.dumps(plan.to_json()))
    assert values["lab"] == str(hall / "lab.yaml")
    assert set(values["lab_sha256"]) == {"hall/lab.yaml", "hall/camera.yaml"}
    monkeypatch.chdir(tmp_path.parent)  # a worker may have another folder
    assert CampaignPlan.from_json(values).differences(plan) == []
    task = FlightTask.from_json(json.loads(json.dumps(next(plan.tasks()).to_json())))
    lab = task.flight_options().lab
    assert isinstance(lab, Lab)
    assert lab.file == hall / "lab.yaml"
    assert make_plan(["land_only"], flights=1, lab="paper").to_json()["lab"] == "paper"


def test_the_plan_keeps_the_network_of_the_lab(hall: Path) -> None:
    before = make_plan(["hop.xml"], flights=1, lab="hall")
    (hall / "segmentation.onnx").write_bytes(b"\x08a network")
    (difference,) = make_plan(["hop.xml"], flights=1, lab="hall").differences(before)
    assert difference.startswith("lab_sha256 hall/segmentation.onnx: was none, now ")


@pytest.mark.parametrize("name", ["lab.yaml", "camera.yaml"])
def test_a_changed_lab_is_not_resumed(hall: Path, tmp_path: Path, name: str) -> None:
    before = make_plan(["hop.xml"], flights=1, lab="hall")
    with CampaignStore.opened(tmp_path / "out", before, {}):
        pass
    assert plan_of(tmp_path / "out").differences(before) == []
    (hall / name).write_text(f"{(hall / name).read_text()}# moved\n")
    (difference,) = plan_of(tmp_path / "out").differences(before)
    assert difference.startswith(f"lab_sha256 hall/{name} has changed")


def test_a_changed_lab_of_a_scene_is_not_resumed(hall: Path) -> None:
    """Without --lab, too: the classes are of the scene's lab."""
    scenes = [str(hall / "scenes" / "east.yaml")]
    before = make_plan(["hop.xml"], scenes=scenes, flights=1)
    (hall / "lab.yaml").write_text(f"{LAB}{MARK}")
    differences = make_plan(["hop.xml"], scenes=scenes, flights=1).differences(before)
    assert any("hall/lab.yaml has changed" in line for line in differences)


def test_another_lab_is_another_campaign(hall: Path) -> None:
    assert hall.is_dir()
    before = make_plan(["land_only"], scenes=["val-a"], flights=1)
    (difference,) = make_plan(["land_only"], scenes=["val-a"], flights=1, lab="paper").differences(
        before
    )
    assert difference.startswith("lab_sha256 paper/lab.yaml: was none, now ")


def test_a_campaign_whose_lab_is_gone_says_so(hall: Path, tmp_path: Path) -> None:
    with CampaignStore.opened(tmp_path / "out", make_plan(["hop.xml"], flights=1, lab="hall"), {}):
        pass
    (hall / "lab.yaml").unlink()
    with pytest.raises(FileError, match=r"labs/hall/lab.yaml: there is no such lab file"):
        plan_of(tmp_path / "out")
