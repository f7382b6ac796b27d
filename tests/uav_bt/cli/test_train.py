"""`uav-bt net train` and `evaluate`: inputs, outputs and refusals."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import torch
from safetensors.numpy import load_file

from perception.segmentation.teacher import load_teacher
from tests.paper_lab import CLASSES
from tests.uav_bt.cli.cli_world import assert_refused, run
from uav_bt.lab.roles import ROLE_NAMES
from uav_bt.learning.teacher import SHIPPED_TEACHER, UNetPlan

ONE_SCENE = ("--scene", "train-a", "--views", 2)


@pytest.fixture(autouse=True)
def _one_thread() -> Iterator[None]:
    """Limit the threads, so that parallel test runs do not compete for the processor."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)


@pytest.fixture
def masks(monkeypatch: pytest.MonkeyPatch) -> list[tuple[Any, ...]]:
    """Replace the masks, which take minutes to compute; return the requests for them."""
    asked: list[tuple[Any, ...]] = []

    def label_views(teacher: Path, plan: Any, folder: Path, **_: Any) -> Any:
        asked.append((teacher, plan, folder))
        rng = np.random.default_rng(0)
        rgb = rng.integers(0, 255, (4, 32, 64, 3), dtype=np.uint8)
        return rgb, rng.integers(0, 17, (4, 32, 64), dtype=np.uint8)

    monkeypatch.setattr("uav_bt.cli.train.label_views", label_views)
    return asked


# --- picks and the teacher ------------------------------------------------------------------------


def test_picks_drawn_from_the_twin_train_a_teacher(tmp_path: Path) -> None:
    teacher = tmp_path / "teacher.safetensors"
    trained = run("net", "train", "teacher", *ONE_SCENE, "--total", 200, "--out", teacher)
    assert trained.exit_code == 0, trained.output
    known = load_teacher(teacher, CLASSES).known
    assert len(known) > 5
    assert f"teacher of {len(known)} classes: {teacher}" in trained.stdout

    score = run(
        "net",
        "evaluate",
        "segmentation",
        "--model",
        teacher,
        "--scene",
        "train-a",
        "--views",
        1,
        "--out",
        tmp_path / "score.json",
    )
    assert score.exit_code == 0, score.output
    scores = json.loads((tmp_path / "score.json").read_text())
    assert scores["pictures"] == 1
    assert tuple(scores["class_iou"]) == CLASSES.names
    assert tuple(scores["role_iou"]) == ROLE_NAMES


def test_a_teacher_learns_from_photographs(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    photograph = np.zeros((360, 640, 3), dtype=np.uint8)
    photograph[:, :320] = (200, 30, 30)
    photograph += rng.integers(0, 20, photograph.shape, dtype=np.uint8)
    cv2.imwrite(str(tmp_path / "a.png"), photograph)
    picks = tmp_path / "picks.csv"
    rows = [f"a.png,{x},{y},carpet,hand" for x in (60, 120, 200) for y in (80, 200)]
    rows += [f"a.png,{x},{y},background,hand" for x in (400, 500, 600) for y in (80, 200)]
    picks.write_text("image,x,y,class,origin\n" + "\n".join(rows) + "\n", encoding="utf-8")
    out = tmp_path / "teacher.safetensors"
    sources = ("--picks", picks, "--photographs", tmp_path)
    result = run("net", "train", "teacher", *sources, "--out", out)
    assert result.exit_code == 0, result.output
    assert len(load_teacher(out, CLASSES).known) == 2


# --- the segmentation U-Net -----------------------------------------------------------------------


def test_training_writes_both_files_and_goes_on_where_it_stopped(
    tmp_path: Path, masks: list[tuple[Any, ...]]
) -> None:
    out, folder = tmp_path / "net.safetensors", tmp_path / "run"
    command = (
        *("net", "train", "segmentation", *ONE_SCENE, "--seed", 5, "--steps", 2),
        *("--loss", "bce_dice", "--run", folder, "--out", out),
    )
    first = run(*command)
    assert first.exit_code == 0, first.output
    assert "training, loss" in first.stderr
    assert out.is_file()
    assert out.with_suffix(".onnx").is_file()
    (asked,) = masks
    assert asked[0] == SHIPPED_TEACHER
    expected = replace(UNetPlan().views, scenes=("train-a",), views=2, seed=5)
    assert asked[1].views == expected
    assert asked[2].parent == folder

    weights = load_file(out)
    out.unlink()
    again = run(*command)
    assert again.exit_code == 0, again.output
    for name, tensor in load_file(out).items():
        np.testing.assert_array_equal(tensor, weights[name], err_msg=name)
    assert masks[1][2] == asked[2]

    longer = run(*command, "--steps", 3)
    assert_refused(longer, "checkpoint.safetensors", "other settings", "delete the file")


def test_a_gpu_that_is_not_there_is_refused_before_anything_is_made(
    tmp_path: Path, masks: list[tuple[Any, ...]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    folder = tmp_path / "run"
    result = run("net", "train", "segmentation", "--device", "cuda", "--run", folder)
    assert_refused(result, "'cuda' needs a GPU", "train on 'cpu'")
    assert not masks
    assert not folder.exists()


def test_masks_of_another_plan_are_not_taken_for_these(
    tmp_path: Path, masks: list[tuple[Any, ...]]
) -> None:
    for number, views in enumerate((2, 3)):
        result = run(
            "net",
            "train",
            "segmentation",
            "--scene",
            "train-a",
            "--views",
            views,
            "--steps",
            1,
            "--run",
            tmp_path / "run",
            "--out",
            tmp_path / f"net{number}.safetensors",
        )
        assert result.exit_code == 0, result.output
    assert masks[0][2] != masks[1][2]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (
            ["train", "teacher", "--picks", "absent.csv", "--photographs", "."],
            ["absent.csv: there is no such picks"],
        ),
        (["train", "teacher", "--photographs", "."], ["--picks"]),
        (["train", "teacher", "--scene", "train-aa"], ["unknown scene 'train-aa'"]),
        (
            ["train", "teacher", "--out", "nowhere/t.safetensors"],
            ["nowhere", "create it first"],
        ),
        (
            ["train", "segmentation", "--teacher", "absent.safetensors"],
            ["absent.safetensors"],
        ),
        (["train", "segmentation", "--out", "net.onnx"], [".safetensors"]),
        (["train", "segmentation", "--loss", "l2"], ["--loss"]),
        (["train", "segmentation", "--steps", "0"], ["--steps"]),
        (["train", "control"], ["control"]),
        (["evaluate", "segmentation", "--model", "absent.onnx"], ["absent.onnx"]),
        (
            ["evaluate", "segmentation", "--model", "absent.safetensors"],
            ["absent.safetensors"],
        ),
        (["evaluate", "segmentation", "--classes", "x.yaml"], ["--classes"]),
        (["evaluate", "segmentation", "--views", "0"], ["--views"]),
    ],
)
def test_a_mistake_is_told_and_nothing_is_written(
    arguments: list[str], words: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    result = run("net", *arguments)
    assert result.exit_code == 2, result.output
    assert "Traceback" not in result.stderr
    for word in words:
        assert word in result.stderr
    assert list(tmp_path.iterdir()) == []
