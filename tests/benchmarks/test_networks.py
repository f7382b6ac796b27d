"""Measurements of networks: segmentation and confidence."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.confidence import JudgedScale, fitted
from benchmarks.lab_views import copy_lab, write_views
from benchmarks.real_rooms import __main__ as real_rooms
from benchmarks.segmentation import evaluate_segmentation, main, scenes_of
from perception.camera.image_files import read_image
from perception.depth.confidence import COEFFICIENTS
from perception.segmentation.runtime import shipped_unet
from perception.segmentation.teacher import TeacherConfig
from tests.paper_lab import CLASSES
from tests.uav_bt.learning.lab_world import write_colour_network
from uav_bt.errors import FileError, InputError
from uav_bt.lab.shipped import load_lab
from uav_bt.learning.lab_data import checked_data
from uav_bt.learning.views import VALIDATION_SCENES, ViewPlan, twin_views

SMALL = TeacherConfig(width_px=320, height_px=180, patch_px=11)


def test_the_shipped_unet_sees_the_validation_scenes_well() -> None:
    plan = ViewPlan(
        scenes=VALIDATION_SCENES, views=15, size_px=(640, 360), truth_size_px=(224, 112), seed=5
    )
    assert evaluate_segmentation(shipped_unet().ids, plan, CLASSES).role_miou >= 0.96


def test_scenes_are_those_of_the_lab() -> None:
    assert scenes_of(load_lab(), "test-*") == ("test-a", "test-b")
    (depot,) = scenes_of(load_lab("depot"), "*val*")
    assert Path(depot).name == "depot-val-a.yaml"
    with pytest.raises(InputError, match="no scene of the lab 'depot' matches 'val': depot-test-a"):
        scenes_of(load_lab("depot"), "val")


def test_the_command_scores_a_network_in_another_lab(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    count = len(load_lab("depot").classes)
    network = write_colour_network(tmp_path / "net.onnx", (0, 1, *[3] * (count - 2)))
    main(f"--lab depot --scenes depot-val-a --views 2 --model {network}".split())
    scores = json.loads(capsys.readouterr().out)
    assert (scores["images"], scores["lab"]) == (2, "depot")
    assert scores["class_iou"]["person"] is None
    assert 0.0 < scores["role_iou"]["ground"] < 1.0


def test_the_network_any_sees_the_floor_of_real_rooms(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    real_rooms.main(["--picture", str(tmp_path / "rooms.webp")])
    *views, total = capsys.readouterr().out.splitlines()
    found = re.fullmatch(r"total of 7 views: recall (0\.\d+), precision (0\.\d+)", total)
    assert found is not None
    assert len(views) == 7
    # The floor of two views is called an obstacle.
    assert float(found[1]) > 0.7
    assert float(found[2]) > 0.8
    picture = read_image(tmp_path / "rooms.webp", colour=True, as_stored=False)
    assert picture.shape == (540, 1440, 3)


@pytest.mark.parametrize(
    ("marks", "picture", "message"),
    [
        ('{"a.jpg": {"line": [[0, 0.6], [1, 0.5]]}}', "p.webp", "a.jpg: no such file"),
        ('{\n"a.jpg": {"line": [[0, 1], [0.5, 1]]}}', "p.webp", "floor.json:2: a.jpg: line"),
        ('{"a.webp": {"line": [[0, 0.6], [1, 0.5]]}}', "a.webp", "a.webp: is an input"),
    ],
)
def test_photographs_or_lines_that_cannot_be_used_are_named(
    marks: str, picture: str, message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "floor.json").write_text(marks)
    (tmp_path / "a.webp").write_bytes(b"an image")
    with pytest.raises(SystemExit) as ended:
        real_rooms.main([str(tmp_path), "--picture", str(tmp_path / picture)])
    assert ended.value.code == 2
    assert message in capsys.readouterr().err


def test_a_drawn_lab_can_be_trained(tmp_path: Path) -> None:
    """The picks lie on the classes that they name, and the shipped lab stays as it is."""
    shipped = load_lab("depot")
    before = sorted(shipped.folder.rglob("*"))
    material = copy_lab(shipped, tmp_path / "depot")
    plan = ViewPlan(scenes=scenes_of(shipped, "depot-train-a"), views=4)
    check = replace(plan, scenes=scenes_of(shipped, "depot-val-a"), views=1)
    write_views(material, {"train": plan, "check": check}, SMALL, 100)
    assert sorted(shipped.folder.rglob("*")) == before

    data = checked_data(material)
    assert (len(data.images("train")), len(data.images("check"))) == (4, 1)
    assert 50 < len(data.picks_on("train")) < 250
    assert data.picks_on("check")
    names = load_lab(material.lab.folder).scenes
    assert "lab:" not in names["depot-train-a"].read_text()
    rgb = read_image(data.images("train")[0], colour=True, as_stored=False)
    assert rgb.shape == (180, 320, 3)
    views = twin_views(replace(plan, size_px=(320, 180)))
    exact = {f"{Path(name).stem}.jpg": ids for name, _, ids in views}
    for pick in data.picks_on("train"):
        assert exact[pick.image][pick.y, pick.x] == pick.class_id
    with pytest.raises(FileError, match="exists: give --out a new folder"):
        copy_lab(shipped, tmp_path / "depot")


# --- the fit of the confidence of a scale ---------------------------------------------------------


def judged(count: int = 400) -> list[JudgedScale]:
    """Return scales that are right where `slope` is high; the other measures are noise."""
    rng = np.random.default_rng(0)
    found = []
    for _ in range(count):
        measures = dict(zip(COEFFICIENTS, rng.random(len(COEFFICIENTS)).tolist(), strict=True))
        right = rng.random() < 1.0 / (1.0 + math.exp(-12.0 * (measures["slope"] - 0.5)))
        found.append(JudgedScale("paper, own network", right, measures["slope"], measures))
    return found


def in_the_middle(of: dict[str, float]) -> float:
    """Return the logit where each measure is a half."""
    return of["intercept"] + 0.5 * sum(of[name] for name in COEFFICIENTS)


def test_the_fit_finds_the_measure_that_tells() -> None:
    found = fitted(judged(), wrong_weight=1.0)
    assert list(found) == ["intercept", *COEFFICIENTS]
    others = [found[name] for name in COEFFICIENTS if name != "slope"]
    assert found["slope"] > 3.0 * max(others)
    assert min(others) >= 0.0
    assert in_the_middle(found) == pytest.approx(0.0, abs=0.5)
    strict = fitted(judged(), wrong_weight=10.0)
    assert in_the_middle(strict) < in_the_middle(found) - 1.0
