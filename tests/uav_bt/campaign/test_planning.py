"""From names to plans: files found, their hashes, variants of parameters, and refusals."""

from __future__ import annotations

import hashlib
import json
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from perception.networks.weights_file import SHIPPED_WEIGHTS
from sim_bridge.twin import scene_file
from tests.sim_bridge.twin.room_world import write_lab
from tests.uav_bt.campaign.campaign_world import keep
from tests.worlds.cli import HOP
from tests.worlds.labs import HALL, MARK, lab_folder
from tests.worlds.trees import tree_file
from uav_bt.app.options import FlightOptions
from uav_bt.campaign import make_plan, plan_of
from uav_bt.campaign.plan import CampaignPlan
from uav_bt.errors import FileError, InputError, SceneError, TreeError
from uav_bt.lab.lab import Lab
from uav_bt.mission.judge import JudgeConfig
from uav_bt.tree.loading.lookup import shipped_trees

SCENES = Path(scene_file.__file__).parent / "scenes"


class Mine:
    """A policy that is an object."""

    def decide(self, view: object) -> None:
        """Decide nothing."""


def test_shipped_missions_and_scenes_are_named_so_that_every_machine_finds_them() -> None:
    plan = make_plan(["land_only"], scenes=["val-*,train-a", "val-a"], flights=1)
    assert [(file.name, file.path) for file in plan.trees] == [("land_only.xml", "land_only")]
    assert [file.path for file in plan.scenes] == ["val-a", "val-b", "train-a"]
    # Files of the library that the mission uses are included.
    parts = ("land_only.xml", "lib/return_to_base.xml", "lib/perceive.xml")
    texts = [(shipped_trees() / name).read_bytes() for name in parts]
    assert plan.trees[0].sha256 == hashlib.sha256(b"\0".join(texts)).hexdigest()
    weights = (SHIPPED_WEIGHTS / "unet.onnx").read_bytes()
    assert plan.weights["unet.onnx"] == hashlib.sha256(weights).hexdigest()
    assert set(plan.weights) == {"unet.onnx", "depth.onnx"}


def test_files_are_found_by_pattern_too(tmp_path: Path) -> None:
    for name in ("one", "two"):
        shutil.copy(SCENES / "val-a.yaml", tmp_path / f"{name}.yaml")
        scene = (tmp_path / f"{name}.yaml").read_text().replace("val-a", name)
        (tmp_path / f"{name}.yaml").write_text(scene)
    plan = make_plan(
        [tree_file(tmp_path, HOP, "hop.xml")], scenes=[f"{tmp_path}/*.yaml"], flights=1
    )
    assert [file.name for file in plan.scenes] == ["one", "two"]
    assert plan.scenes[0].path == str(tmp_path / "one.yaml")
    assert plan.trees[0].path == str(tmp_path / "hop.xml")
    assert plan.weights == {}, "its leaves need none"


def test_a_changed_include_changes_the_plan_of_the_folder(tmp_path: Path) -> None:
    part = tmp_path / "part.xml"
    text = '<root BTCPP_format="4"><BehaviorTree ID="Part">{}</BehaviorTree></root>'
    part.write_text(text.format(HOP))
    main = tree_file(tmp_path, '<SubTree ID="Part"/>', "main.xml", '<include path="part.xml"/>')
    before = make_plan([main], scenes=["val-a"], flights=2, profile="ideal", seed_from=3)
    keep(tmp_path / "out", of=before)
    assert plan_of(tmp_path / "out") == before
    part.write_text(text.format(f"<ForceSuccess>{HOP}</ForceSuccess>"))
    (difference,) = plan_of(tmp_path / "out").differences(before)
    assert difference.startswith("trees main.xml sha256 has changed")


@pytest.mark.parametrize(
    ("how", "error", "message"),
    [
        ({"scenes": ["bad.yaml"]}, SceneError, "bad.yaml"),
        ({"trees": ["bad.xml"]}, TreeError, "Nonsense"),
        ({"trees": ["survey_and_land"], "policies": {"Explore": "nobody"}}, InputError, "nobody"),
        ({"scenes": [","]}, InputError, "at least one scene"),
        ({"scenes": ["nothing-*"]}, InputError, r"scene pattern 'nothing-\*'"),
        ({"trees": ["<root/>"]}, InputError, "a campaign flies tree files, which its workers read"),
        (
            {"trees": ["survey_and_land"], "policies": {"Explore": Mine()}},
            InputError,
            "a campaign's policies are names of installed policies",
        ),
    ],
)
def test_what_cannot_be_flown_is_refused(
    how: dict[str, Any],
    error: type[InputError],
    message: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("bad.yaml").write_text("boxes: []\n")
    tree_file(tmp_path, "<Nonsense/>", "bad.xml")
    with pytest.raises(error, match=message):
        make_plan(**{"trees": ["land_only"], **how})


def test_ports_leaves_and_time_limit_travel_with_the_plan(tmp_path: Path) -> None:
    leaves = tmp_path / "my_leaves.py"
    leaves.write_text(
        "from uav_bt.tree import Leaf, Status\n"
        "class Wait(Leaf):\n"
        "    def update(self):\n"
        "        return Status.SUCCESS\n"
    )
    file = tree_file(tmp_path, "<Sequence><TakeOff/><Wait/><Land/></Sequence>", "wait.xml")
    options = FlightOptions(
        ports={"TakeOff.height_m": 1.1}, leaves=[leaves], judge=JudgeConfig(time_limit_s=50.0)
    )
    plan = make_plan([file], options, flights=1)
    assert plan.leaves_sha256 == {str(leaves): hashlib.sha256(leaves.read_bytes()).hexdigest()}
    again = CampaignPlan.from_json(json.loads(json.dumps(plan.to_json())))
    assert not again.differences(plan)
    how = next(again.tasks()).options
    assert how.judge == options.judge
    assert how.ports == {"TakeOff.height_m": "1.1"}
    assert [str(each) for each in how.leaves] == [str(leaves)]
    slower = make_plan([file], replace(options, ports={"TakeOff.height_m": 1.2}), flights=1)
    assert slower.differences(plan) == ["ports TakeOff.height_m: was 1.1, now 1.2"]
    leaves.write_text(leaves.read_text() + "\n")
    assert "leaves_sha256" in "".join(make_plan([file], options, flights=1).differences(plan))


def test_a_mesh_of_the_lab_is_part_of_the_plan(tmp_path: Path) -> None:
    folder = write_lab(tmp_path / "hall")
    scene = folder / "scenes" / "one.yaml"
    scene.write_text("take_off: {from: [0, 0]}", encoding="utf-8")
    before = make_plan(["land_only"], scenes=[str(scene)], flights=1)
    mesh = folder / "cone.obj"
    mesh.write_text(mesh.read_text("utf-8").replace("v 0.5 0.5 1", "v 0.5 0.5 2"), "utf-8")
    (difference,) = make_plan(["land_only"], scenes=[str(scene)], flights=1).differences(before)
    assert difference.startswith("lab_sha256 hall/cone.obj has changed")


# --- variants of the parameters -----------------------------------------------------------------

BODY = '<Sequence><TakeOff height_m="1.0"/><HoverFor seconds="{wait_s}"/><Land/></Sequence>'
VARIANTS = """
set: {TakeOff.height_m: 1.1}
var: {wait_s: 1}
variants:
  slow: {}
  fast: {var: {wait_s: 2}, set: {TakeOff.height_m: 1.2}}
"""


@pytest.fixture
def hop(tmp_path: Path) -> Path:
    return tree_file(tmp_path, BODY, "hop.xml")


@pytest.fixture
def params(tmp_path: Path) -> Path:
    path = tmp_path / "params.yaml"
    path.write_text(VARIANTS)
    return path


def flown(plan: CampaignPlan) -> dict[str, tuple[object, object]]:
    """Return height and wait of each tree's flights, as their workers get them."""
    options = {task.tree: task.options for task in plan.tasks()}
    return {
        tree: (how.ports.get("TakeOff.height_m"), how.variables.get("wait_s"))
        for tree, how in options.items()
    }


def test_each_variant_is_a_row_of_its_own(hop: Path, params: Path, tmp_path: Path) -> None:
    plan = make_plan([hop], params=params, flights=1, scenes=["val-a"])
    assert flown(plan) == {"hop[slow].xml": ("1.1", 1), "hop[fast].xml": ("1.2", 2)}
    # The command line counts before every variant.
    five = make_plan([hop], params=params, variables={"wait_s": 5}, flights=1, scenes=["val-a"])
    assert flown(five) == {"hop[slow].xml": ("1.1", 5), "hop[fast].xml": ("1.2", 5)}
    # A campaign goes on without the file.
    keep(tmp_path / "run", of=plan)
    params.unlink()
    again = plan_of(tmp_path / "run")
    assert flown(again) == flown(plan)
    assert again.differences(plan) == []


def test_another_value_is_another_campaign(hop: Path, params: Path) -> None:
    before = make_plan([hop], params=params, flights=1, scenes=["val-a"])
    params.write_text(VARIANTS.replace("wait_s: 2", "wait_s: 3"))
    now = make_plan([hop], params=params, flights=1, scenes=["val-a"])
    assert now.differences(before) == ["trees hop[fast].xml variables wait_s: was 2, now 3"]


def test_a_wrong_value_of_a_variant_is_refused_by_its_line(hop: Path, params: Path) -> None:
    params.write_text(VARIANTS.replace("wait_s: 2", "wait: 2"))
    with pytest.raises(InputError, match=r"params.yaml:6:1: no node uses a variable 'wait'"):
        make_plan([hop], params=params, flights=1)


# --- campaigns in a lab --------------------------------------------------------------------------


@pytest.fixture
def hall(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A lab with two scenes in `labs/` of the working directory."""
    monkeypatch.chdir(tmp_path)
    text = f"{HALL}{MARK}camera: camera.yaml\n"
    folder = lab_folder(tmp_path / "labs" / "hall", text, scenes=("east", "west"))
    (folder / "camera.yaml").touch()
    tree_file(tmp_path, HOP, "hop.xml")
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
def test_a_changed_lab_is_refused(hall: Path, tmp_path: Path, name: str, *, by_lab: bool) -> None:
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
