"""Training and evaluation of the perception on pictures of the twin.

`perception` learns from any iterable of samples; this module makes the samples: it renders the
scenes, lets the teacher look at them, and hands both on.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass, field, replace
from multiprocessing import get_context
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np

from perception.networks.weights_file import SHIPPED_WEIGHTS
from perception.segmentation.clean import RefineConfig
from perception.segmentation.evaluation import SegmentationScore, score_segmentation
from perception.segmentation.teacher import Teacher, TeacherConfig, fit_teacher, load_teacher
from perception.segmentation.training.picks import Pick, draw_picks, gather_patches, read_picks
from uav_bt.errors import FileError
from uav_bt.files import whole_file
from uav_bt.learning.views import Image, ViewPlan, twin_views
from uav_bt.protocols import Advance, silent

SHIPPED_TEACHER: Final = SHIPPED_WEIGHTS / "teacher.safetensors"
UNET_WEIGHTS: Final = SHIPPED_WEIGHTS / "unet.safetensors"


# --- the teacher ----------------------------------------------------------------------------------


def draw_twin_picks(
    plan: ViewPlan, config: TeacherConfig, *, total: int = 6500, advance: Advance = silent
) -> list[Pick]:
    """Draw points from the exact ids in a person's place, evenly over the plan's scenes."""
    picks: list[Pick] = []
    size = (config.width_px, config.height_px)
    for done, scene in enumerate(plan.scenes, start=1):
        views = twin_views(replace(plan, scenes=(scene,), size_px=size, truth_size_px=size))
        samples = ((name, ids) for name, _, ids in views)
        rng = np.random.default_rng((plan.seed, done))
        share = total // len(plan.scenes)
        picks.extend(draw_picks(samples, rng, patch_px=config.patch_px, total=share))
        advance("picks", done, len(plan.scenes))
    return picks


def train_teacher(
    picks: Sequence[Pick], plan: ViewPlan, config: TeacherConfig, *, advance: Advance = silent
) -> Teacher:
    """Train the teacher on picks of the plan's pictures."""
    wanted = {pick.image for pick in picks}
    total = plan.views * len(plan.scenes)

    def pictures() -> Iterator[tuple[str, Image]]:
        small = replace(plan, size_px=(config.width_px, config.height_px), truth_size_px=(32, 18))
        for done, (name, rgb, _) in enumerate(twin_views(small), start=1):
            if name in wanted:
                yield name, rgb
            advance("patches", done, total)

    return fit_teacher(gather_patches(picks, pictures(), config.patch_px), config, seed=plan.seed)


def train_teacher_on_photographs(picks_path: Path, folder: Path, config: TeacherConfig) -> Teacher:
    """Train the teacher on a picks file and the photographs it names.

    Raises:
        FileError: a file is absent or malformed.
    """
    picks = read_picks(picks_path)
    scaled: list[Pick] = []
    pictures: dict[str, Image] = {}
    for name in dict.fromkeys(pick.image for pick in picks):
        bgr = cv2.imread(str(folder / name), cv2.IMREAD_COLOR)
        if bgr is None:
            raise FileError(folder / name, f"is no readable picture, yet {picks_path} names it")
        size = (config.width_px, config.height_px)
        small = cv2.resize(bgr, size, interpolation=cv2.INTER_AREA)
        pictures[name] = np.asarray(cv2.cvtColor(small, cv2.COLOR_BGR2RGB), dtype=np.uint8)
        height, width = bgr.shape[:2]
        scaled.extend(
            replace(pick, x=pick.x * size[0] // width, y=pick.y * size[1] // height)
            for pick in picks
            if pick.image == name
        )
    return fit_teacher(gather_patches(scaled, pictures.items(), config.patch_px), config)


# --- the student ----------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class UNetPlan:
    """What the segmentation U-Net learns from: the teacher's masks, never the exact ids."""

    views: ViewPlan = field(default_factory=lambda: ViewPlan(views=875, seed=1))  # 3,500 in all
    refine: RefineConfig = field(default_factory=RefineConfig)
    size_px: tuple[int, int] = (224, 112)  # of the labels and of the pictures the net sees


def label_pictures(
    teacher_path: Path,
    plan: UNetPlan,
    folder: Path,
    *,
    workers: int = 1,
    advance: Advance = silent,
) -> tuple[Image, Image]:
    """Let the teacher label the plan's pictures; scenes already done in the folder are kept.

    Args:
        teacher_path: the teacher's weights.
        plan: which pictures.
        folder: where each scene's result is kept, so that a broken-off run goes on.
        workers: processes; scenes are shared out among them.
        advance: told when a scene is done.

    Returns:
        Pictures (N, h, w, 3) and the teacher's ids (N, h, w).
    """
    folder.mkdir(parents=True, exist_ok=True)
    files = [folder / f"labels-{Path(name).stem}.npz" for name in plan.views.scenes]
    todo = [number for number, file in enumerate(files) if not file.is_file()]
    advance("labels", len(files) - len(todo), len(files))
    # Not forked: a forked OpenGL context draws nothing.
    with ProcessPoolExecutor(max_workers=workers, mp_context=get_context("spawn")) as pool:
        jobs = [
            pool.submit(_label_scene, teacher_path, plan, plan.views.scenes[number], files[number])
            for number in todo
        ]
        for done, job in enumerate(as_completed(jobs), start=len(files) - len(todo) + 1):
            job.result()
            advance("labels", done, len(files))
    parts = [np.load(file, allow_pickle=False) for file in files]
    return (
        np.concatenate([part["rgb"] for part in parts]),
        np.concatenate([part["ids"] for part in parts]),
    )


def _label_scene(teacher_path: Path, plan: UNetPlan, scene: str, file: Path) -> None:
    teacher = load_teacher(teacher_path)
    rgbs, labels = [], []
    for _, image, _ in twin_views(replace(plan.views, scenes=(scene,), truth_size_px=(32, 18))):
        ids = teacher.refined_ids(teacher.resized(image), plan.refine)
        rgbs.append(cv2.resize(image, plan.size_px, interpolation=cv2.INTER_AREA))
        labels.append(cv2.resize(ids, plan.size_px, interpolation=cv2.INTER_NEAREST_EXACT))
    with whole_file(file) as partial, partial.open("wb") as out:
        np.savez_compressed(out, rgb=np.stack(rgbs), ids=np.stack(labels))


def train_segmentation(
    pictures: tuple[Image, Image],
    weights: Path,
    *,
    config: Any = None,
    checkpoint: Path | None = None,
    advance: Advance = silent,
) -> None:
    """Train the U-Net and write its safetensors and, beside them, the ONNX file made from them.

    Args:
        pictures: (N, h, w, 3) and labels (N, h, w), as `label_pictures` gives them.
        weights: the safetensors file; the ONNX file has the same name.
        config: a `perception.segmentation.training.run.TrainingConfig`; None for its defaults.
        checkpoint: the state of a run to go on from, and to keep.
        advance: told after every step, with the loss in the stage's name.
    """
    from perception.segmentation.training import (  # noqa: PLC0415  (torch: only training needs it)
        run,
        unet,
    )

    settings = run.TrainingConfig() if config is None else config
    rgb, ids = pictures
    net = run.train_unet(
        run.LabelledImages(rgb=rgb, ids=ids),
        settings,
        unet.UNetConfig(width_px=rgb.shape[2], height_px=rgb.shape[1]),
        checkpoint=checkpoint,
        progress=lambda now, _net: advance(f"training, loss {now.loss:.3f}", now.step, now.steps),
    )
    notes = {"training": asdict(settings), "images": len(rgb)}
    unet.UNET_FILES.save(weights, net, notes=notes)
    unet.UNET_FILES.export(weights, weights.with_suffix(".onnx"))


# --- evaluation -----------------------------------------------------------------------------------


def evaluate_segmentation(
    segment: Callable[[Image], Image], plan: ViewPlan, *, advance: Advance = silent
) -> SegmentationScore:
    """Score a segmentation against the twin's exact ids.

    Args:
        segment: (H, W, 3) RGB to (h, w) class ids; `OnnxSegmenter.ids`, for instance.
        plan: which pictures.
        advance: told after every picture.
    """
    total = plan.views * len(plan.scenes)

    def pairs() -> Iterator[tuple[Image, Image]]:
        for done, (_, rgb, ids) in enumerate(twin_views(plan), start=1):
            yield segment(rgb), ids
            advance("evaluation", done, total)

    return score_segmentation(pairs())
