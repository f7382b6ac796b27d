"""Campaigns in a lab: its scenes, and its files in the plan."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.uav_bt.app.test_lab_flights import LAB, MARK, SCENE
from tests.uav_bt.campaign.campaign_world import keep
from tests.uav_bt.campaign.test_planning import tree
from uav_bt.campaign import make_plan, plan_of
from uav_bt.campaign.plan import CampaignPlan
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
    again = CampaignPlan.from_json(values)
    assert again.differences(plan) == []
    lab = next(again.tasks()).options.lab
    assert isinstance(lab, Lab)
    assert lab.file == hall / "lab.yaml"


@pytest.mark.parametrize(
    ("name", "by_lab"), [("lab.yaml", True), ("lab.yaml", False), ("camera.yaml", True)]
)
def test_a_changed_lab_is_not_resumed(
    hall: Path, tmp_path: Path, name: str, *, by_lab: bool
) -> None:
    """Without --lab, too: the classes are of the scene's lab."""
    how = {"lab": "hall"} if by_lab else {"scenes": [str(hall / "scenes" / "east.yaml")]}
    before = make_plan(["hop.xml"], flights=1, **how)
    keep(tmp_path / "out", of=before)
    assert plan_of(tmp_path / "out").differences(before) == []
    (hall / name).write_text(f"{(hall / name).read_text()}# moved\n")
    (hall / "segmentation.onnx").write_bytes(b"\x08a network")
    differences = plan_of(tmp_path / "out").differences(before)
    assert [each.partition(":")[0][:40] for each in differences] == [
        f"lab_sha256 hall/{name} has changed (SHA-256 "[:40],
        "lab_sha256 hall/segmentation.onnx",
    ]


def test_another_lab_is_another_campaign(hall: Path) -> None:
    assert hall.is_dir()
    before = make_plan(["land_only"], scenes=["val-a"], flights=1)
    paper = make_plan(["land_only"], scenes=["val-a"], flights=1, lab="paper")
    assert paper.to_json()["lab"] == "paper"
    (difference,) = paper.differences(before)
    assert difference.startswith("lab_sha256 paper/lab.yaml: was none, now ")


def test_a_campaign_whose_lab_is_gone_says_so(hall: Path, tmp_path: Path) -> None:
    keep(tmp_path / "out", of=make_plan(["hop.xml"], flights=1, lab="hall"))
    (hall / "lab.yaml").unlink()
    with pytest.raises(FileError, match=r"labs/hall/lab.yaml: there is no such lab file"):
        plan_of(tmp_path / "out")
