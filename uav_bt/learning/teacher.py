"""Teacher of the segmentation: it is trained on picks and labels the images for the U-Net."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, field, replace
from multiprocessing import get_context
from pathlib import Path
from typing import Final

import cv2
import numpy as np

from perception.networks.onnx_runtime import shrunk
from perception.networks.weights_file import SHIPPED_WEIGHTS
from perception.odometry.camera_track import shrink
from perception.segmentation.clean import RefineConfig
from perception.segmentation.teacher import Teacher, TeacherConfig, fit_teacher, load_teacher
from perception.segmentation.training.picks import Pick, draw_picks, gather_patches, read_picks
from uav_bt.errors import FileError, InputError, ValueRangeError
from uav_bt.files import whole_file
from uav_bt.lab.classes import LabClasses
from uav_bt.lab.shipped import load_lab
from uav_bt.learning.dataset import fingerprint, image_of, spaced
from uav_bt.learning.views import ViewPlan, twin_views
from uav_bt.progress import Advance, silent
from uav_bt.record.footage import flight_record, footage
from uav_bt.record.moment import StoredFrame
from uav_bt.types.arrays import Image

SHIPPED_TEACHER: Final = SHIPPED_WEIGHTS / "teacher.safetensors"

_PART: Final = 100  # number of images to label at a time


# --- training -------------------------------------------------------------------------------------


def draw_twin_picks(
    plan: ViewPlan, config: TeacherConfig, *, total: int = 6500, advance: Advance = silent
) -> list[Pick]:
    """Sample points of the exact ids instead of manual picks, evenly over the plan's scenes."""
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
    picks: Sequence[Pick],
    plan: ViewPlan,
    config: TeacherConfig,
    classes: LabClasses,
    *,
    advance: Advance = silent,
) -> Teacher:
    """Train the teacher on picks of the plan's images."""
    wanted = {pick.image for pick in picks}
    total = plan.views * len(plan.scenes)

    def images() -> Iterator[tuple[str, Image]]:
        small = replace(plan, size_px=(config.width_px, config.height_px), truth_size_px=(32, 18))
        for done, (name, rgb, _) in enumerate(twin_views(small), start=1):
            if name in wanted:
                yield name, rgb
            advance("patches", done, total)

    patches = gather_patches(picks, images(), config.patch_px, classes)
    return fit_teacher(patches, config, seed=plan.seed)


def train_teacher_on_photographs(
    picks_path: Path, folder: Path, config: TeacherConfig, classes: LabClasses
) -> Teacher:
    """Train the teacher on a picks file and its photographs.

    Raises:
        FileError: a file is missing or malformed.
    """
    picks = read_picks(picks_path, classes)
    scaled: list[Pick] = []
    images: dict[str, Image] = {}
    for name in dict.fromkeys(pick.image for pick in picks):
        bgr = cv2.imread(str(folder / name), cv2.IMREAD_COLOR)
        if bgr is None:
            raise FileError(folder / name, f"is not a readable image, but {picks_path} names it")
        size = (config.width_px, config.height_px)
        small = cv2.resize(bgr, size, interpolation=cv2.INTER_AREA)
        images[name] = np.asarray(cv2.cvtColor(small, cv2.COLOR_BGR2RGB), dtype=np.uint8)
        height, width = bgr.shape[:2]
        scaled.extend(
            replace(pick, x=pick.x * size[0] // width, y=pick.y * size[1] // height)
            for pick in picks
            if pick.image == name
        )
    return fit_teacher(gather_patches(scaled, images.items(), config.patch_px, classes), config)


# --- labels ---------------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class UNetPlan:
    """Training data of the U-Net: masks of the teacher, never the exact ids."""

    # Images for the teacher.
    views: ViewPlan = field(default_factory=lambda: ViewPlan(views=1200, lowered=0.25, seed=1))
    # The network gets frames from the same poses, degraded by these profiles in turn.
    frame_size_px: tuple[int, int] = (640, 360)
    profiles: tuple[str, ...] = ("lab", "harsh")
    refine: RefineConfig = field(default_factory=RefineConfig)
    size_px: tuple[int, int] = (224, 112)  # size of the labels and of the network's images


def label_views(
    teacher_path: Path,
    plan: UNetPlan,
    folder: Path,
    *,
    workers: int = 1,
    advance: Advance = silent,
) -> tuple[Image, Image]:
    """Label the images of a plan with the teacher; finished parts in the folder are reused.

    Args:
        teacher_path: weights of the teacher.
        plan: the images.
        folder: cache of each part's result, so that an interrupted run can continue.
        workers: number of processes that share the parts.
        advance: called after each part.

    Returns:
        Images (N, h, w, 3) and the teacher's ids (N, h, w).
    """
    folder.mkdir(parents=True, exist_ok=True)
    parts = {folder / f"labels-{name}.npz": views for name, views in _parts(plan.views)}
    todo = {file: views for file, views in parts.items() if not file.is_file()}
    advance("labels", len(parts) - len(todo), len(parts))
    # Spawned, because a forked OpenGL context draws nothing.
    with ProcessPoolExecutor(max_workers=workers, mp_context=get_context("spawn")) as pool:
        jobs = [
            pool.submit(_label, teacher_path, replace(plan, views=views), file)
            for file, views in todo.items()
        ]
        for done, job in enumerate(as_completed(jobs), start=len(parts) - len(todo) + 1):
            job.result()
            advance("labels", done, len(parts))
    rgb, ids = zip(*(_kept_labels(file) for file in parts), strict=True)
    return np.concatenate(rgb), np.concatenate(ids)


def _parts(views: ViewPlan) -> Iterator[tuple[str, ViewPlan]]:
    """Split a plan into parts of one scene each; yield their names and plans."""
    for scene in views.scenes:
        for number, first in enumerate(range(0, views.views, _PART)):
            part = replace(
                views,
                scenes=(scene,),
                views=min(_PART, views.views - first),
                seed=(views.seed << 16) + number,
            )
            yield f"{Path(scene).stem}-{number}", part


def _label(teacher_path: Path, plan: UNetPlan, file: Path) -> None:
    """Label the images of a part."""
    teacher = load_teacher(teacher_path, load_lab().classes)
    views = replace(plan.views, truth_size_px=(32, 18))
    labels = [
        cv2.resize(
            teacher.refined_ids(teacher.resized(image), plan.refine),
            plan.size_px,
            interpolation=cv2.INTER_NEAREST_EXACT,
        )
        for _, image, _ in twin_views(views)
    ]
    frames = [
        [shrunk(image, plan.size_px) for _, image, _ in twin_views(degraded)]
        for degraded in (
            replace(views, size_px=plan.frame_size_px, profile=profile) for profile in plan.profiles
        )
    ]
    rgbs = [frames[number % len(frames)][number] for number in range(len(labels))]
    with whole_file(file) as partial, partial.open("wb") as out:
        np.savez_compressed(out, rgb=np.stack(rgbs), ids=np.stack(labels))


def _kept_labels(file: Path) -> tuple[Image, Image]:
    try:
        with np.load(file, allow_pickle=False) as kept:
            return kept["rgb"], kept["ids"]
    except Exception as error:  # numpy raises various errors of zip, zlib and its parser
        raise FileError(file, f"is damaged ({error}); delete it, and it is made again") from error


def label_flights(
    teacher_path: Path,
    records: Sequence[Path],
    plan: UNetPlan,
    folder: Path,
    *,
    every_s: float = 1.0,
    advance: Advance = silent,
) -> tuple[Image, Image]:
    """Label frames of flights with the teacher; finished flights in the folder are reused.

    Args:
        teacher_path: the teacher's weights.
        records: flight records (mcap).
        plan: sharpening and size of the masks; its views are not used.
        folder: cache of each flight's result, so that an interrupted run can continue.
        every_s: time between two frames of a flight; nearer frames are too similar.
        advance: called after each frame.

    Returns:
        Images (N, h, w, 3) and the teacher's ids (N, h, w).

    Raises:
        FileError: a record or the teacher is missing or damaged.
        InputError: the flights have no frame.
    """
    if not every_s > 0.0:
        raise ValueRangeError(f"the time between two frames must be positive, got {every_s} s")
    teacher = load_teacher(teacher_path, load_lab().classes)
    folder.mkdir(parents=True, exist_ok=True)
    parts = [
        _labelled(teacher, record, plan, folder, every_s=every_s, advance=advance)
        for record in records
    ]
    if not any(len(rgb) for rgb, _ in parts):
        raise InputError("there is no frame in these flights to learn from")
    return np.concatenate([rgb for rgb, _ in parts]), np.concatenate([ids for _, ids in parts])


def _labelled(
    teacher: Teacher,
    record: Path,
    plan: UNetPlan,
    folder: Path,
    *,
    every_s: float,
    advance: Advance,
) -> tuple[Image, Image]:
    reader = flight_record(record)
    file = folder / f"labels-{record.stem}-{fingerprint(record)}-{every_s:g}s.npz"
    if file.is_file():
        return _kept_labels(file)
    found = (item for item in footage(reader) if isinstance(item, StoredFrame))
    frames = list(spaced(found, every_s))
    teacher_px = (teacher.config.width_px, teacher.config.height_px)
    width, height = plan.size_px
    rgbs = np.zeros((len(frames), height, width, 3), dtype=np.uint8)
    ids = np.zeros((len(frames), height, width), dtype=np.uint8)
    for done, frame in enumerate(frames):
        image = shrink(image_of(frame, record), teacher_px)
        mask = teacher.refined_ids(image, plan.refine)
        rgbs[done] = shrink(image, plan.size_px)
        ids[done] = cv2.resize(mask, plan.size_px, interpolation=cv2.INTER_NEAREST_EXACT)
        advance(f"labels, {record.stem}", done + 1, len(frames))
    with whole_file(file) as partial, partial.open("wb") as out:
        np.savez_compressed(out, rgb=rgbs, ids=ids)
    return rgbs, ids
