"""Training and evaluation on a few images of the twin."""

from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

import cv2
import numpy as np
import pytest
import torch

from perception.segmentation.clean import RefineConfig
from perception.segmentation.runtime import OnnxSegmenter, shipped_unet
from perception.segmentation.teacher import Teacher, TeacherConfig, load_teacher, save_teacher
from perception.segmentation.training.picks import Pick, write_picks
from perception.segmentation.training.run import TrainingConfig
from tests.paper_lab import CARPET, CLASSES
from uav_bt.errors import FileError, UnknownNameError, ValueRangeError
from uav_bt.learning import teacher as learning
from uav_bt.learning.evaluation import evaluate_segmentation
from uav_bt.learning.training import train_segmentation
from uav_bt.learning.views import VALIDATION_SCENES, ViewPlan, twin_views
from uav_bt.types.arrays import Image

T = TypeVar("T")

SMALL = TeacherConfig(width_px=320, height_px=180, patch_px=11)
PLAN = ViewPlan(scenes=("train-a", "train-b"), views=14, size_px=(320, 180))


@pytest.fixture(autouse=True)
def _one_thread() -> Iterator[None]:
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)


@pytest.fixture(scope="module")
def picks() -> list[Pick]:
    return learning.draw_twin_picks(PLAN, SMALL, total=1200)


@pytest.fixture(scope="module")
def teacher(picks: list[Pick]) -> Teacher:
    return learning.train_teacher(picks, PLAN, SMALL, CLASSES)


def test_a_plan_gives_the_same_pictures_whichever_scenes_stand_beside() -> None:
    plan = replace(PLAN, views=2)
    both = list(twin_views(plan))
    alone = list(twin_views(replace(plan, scenes=("train-b",))))
    assert [name for name, _, _ in both] == [
        "train-a-00000.png",
        "train-a-00001.png",
        "train-b-00000.png",
        "train-b-00001.png",
    ]
    for (name, rgb, ids), (other_name, other_rgb, other_ids) in zip(both[2:], alone, strict=True):
        assert name == other_name
        np.testing.assert_array_equal(rgb, other_rgb)
        np.testing.assert_array_equal(ids, other_ids)


def test_another_seed_gives_other_pictures() -> None:
    (_, first, _), (_, second, _) = (next(twin_views(replace(PLAN, seed=seed))) for seed in (0, 1))
    assert (first != second).mean() > 0.5


def test_picks_are_drawn_from_every_scene(picks: list[Pick]) -> None:
    assert 1000 < len(picks) < 1600
    assert {pick.image[:7] for pick in picks} == {"train-a", "train-b"}
    assert {pick.origin for pick in picks} == {"simulated"}


def test_the_teacher_learns_the_twins_patterns(teacher: Teacher) -> None:
    plan = replace(PLAN, scenes=("val-a",), views=10)
    score = evaluate_segmentation(teacher.window_ids, plan, CLASSES)
    assert score.images == 10
    assert score.role_miou > 0.8


class InProcess(Executor):
    """Runs each call at once in this process: a new process takes seconds to start."""

    def submit(self, fn: Callable[..., T], /, *args: Any, **kwargs: Any) -> Future[T]:
        done: Future[T] = Future()
        done.set_result(fn(*args, **kwargs))
        return done


def test_labelling_keeps_what_is_done_and_training_writes_both_files(
    teacher: Teacher, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    weights = tmp_path / "teacher.safetensors"
    save_teacher(weights, teacher)
    plan = learning.UNetPlan(
        views=replace(PLAN, views=2),
        frame_size_px=(160, 90),
        refine=RefineConfig(rounds=1),
        size_px=(64, 32),
    )
    told: list[tuple[str, int, int]] = []
    folder = tmp_path / "labels"
    rgb, ids = learning.label_views(weights, plan, folder, advance=lambda *now: told.append(now))
    assert rgb.shape == (4, 32, 64, 3)
    assert ids.shape == (4, 32, 64)
    assert told[-1] == ("labels", 2, 2)
    first = folder / "labels-train-a-0.npz"
    made = first.stat().st_mtime_ns
    (folder / "labels-train-b-0.npz").unlink()
    monkeypatch.setattr(learning, "ProcessPoolExecutor", lambda **_: InProcess())
    again, _ = learning.label_views(weights, plan, folder)
    np.testing.assert_array_equal(again, rgb)
    assert first.stat().st_mtime_ns == made

    steps: list[int] = []
    train_segmentation(
        (rgb, ids),
        CLASSES,
        tmp_path / "unet.safetensors",
        config=TrainingConfig(steps=2, batch=2),
        checkpoint=tmp_path / "run.safetensors",
        advance=lambda _stage, done, _total: steps.append(done),
    )
    assert steps == [1, 2]
    assert OnnxSegmenter(tmp_path / "unet.onnx", CLASSES).ids(rgb[0]).shape == (32, 64)


def test_the_network_gets_frames_of_each_profile_in_turn_and_the_teachers_ids(
    teacher: Teacher, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(learning, "ProcessPoolExecutor", lambda **_: InProcess())
    weights = tmp_path / "teacher.safetensors"
    save_teacher(weights, teacher)

    def labelled(*profiles: str) -> tuple[Image, Image]:
        plan = learning.UNetPlan(
            views=replace(PLAN, scenes=("train-a",), views=2),
            frame_size_px=(160, 90),
            profiles=profiles,
            refine=RefineConfig(rounds=0),
            size_px=(64, 32),
        )
        return learning.label_views(weights, plan, tmp_path / "-".join(profiles))

    (ideal, ids), (harsh, same), (both, _) = (
        labelled("ideal"),
        labelled("harsh"),
        labelled("ideal", "harsh"),
    )
    np.testing.assert_array_equal(ids, same)
    np.testing.assert_array_equal(both, [ideal[0], harsh[1]])
    off = np.abs(harsh.astype(int) - ideal)
    assert 1.0 < off.mean() < 20.0, "the same places, degraded"


def test_the_teacher_learns_from_photographs_of_any_size(picks: list[Pick], tmp_path: Path) -> None:
    """Images of twice the size, with picks in their pixels."""
    large: list[Pick] = []
    for name, rgb, _ in twin_views(PLAN):
        mine = [pick for pick in picks if pick.image == name]
        if mine:
            big = cv2.resize(rgb, (640, 360), interpolation=cv2.INTER_NEAREST)
            cv2.imwrite(str(tmp_path / name), big[..., ::-1])
            large += [replace(pick, x=2 * pick.x, y=2 * pick.y, origin="hand") for pick in mine]
    write_picks(tmp_path / "picks.csv", large, CLASSES)
    learned = learning.train_teacher_on_photographs(
        tmp_path / "picks.csv", tmp_path, SMALL, CLASSES
    )
    same = learning.train_teacher(picks, PLAN, SMALL, CLASSES)
    assert learned.known == same.known
    score = evaluate_segmentation(
        learned.window_ids, replace(PLAN, scenes=("val-a",), views=6), CLASSES
    )
    assert score.role_iou[CARPET] > 0.9


def test_a_picture_that_is_not_there_is_named(tmp_path: Path) -> None:
    write_picks(tmp_path / "picks.csv", [Pick(image="none.png", x=1, y=1, class_id=1)], CLASSES)
    with pytest.raises(FileError, match=r"none\.png: is not a readable image"):
        learning.train_teacher_on_photographs(tmp_path / "picks.csv", tmp_path, SMALL, CLASSES)


def test_bad_plans_are_refused() -> None:
    with pytest.raises(ValueRangeError, match="a scene and a positive count"):
        ViewPlan(scenes=())
    with pytest.raises(ValueRangeError, match="within 0 and 1"):
        ViewPlan(facing_pad=1.5)
    with pytest.raises(UnknownNameError, match="unknown scene 'train-z'"):
        next(twin_views(replace(PLAN, scenes=("train-z",))))


def test_the_shipped_unet_sees_the_validation_scenes_well() -> None:
    plan = ViewPlan(
        scenes=VALIDATION_SCENES,
        views=15,
        size_px=(640, 360),
        truth_size_px=(224, 112),
        seed=5,
    )
    assert evaluate_segmentation(shipped_unet().ids, plan, CLASSES).role_miou >= 0.96


def test_the_shipped_teacher_knows_all_classes() -> None:
    assert load_teacher(learning.SHIPPED_TEACHER, CLASSES).known == tuple(range(17))
