"""Frames of recorded flights with the teacher's masks: what the U-Net learns from a real lab."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

from perception.odometry.camera_track import shrink
from perception.segmentation.teacher import Teacher, load_teacher
from uav_bt.errors import InputError, ValueRangeError
from uav_bt.files import whole_file
from uav_bt.learning.dataset import fingerprint, image_of, spaced
from uav_bt.learning.segmentation import UNetPlan
from uav_bt.learning.views import Image
from uav_bt.protocols import Advance, silent
from uav_bt.record.footage import flight_record, footage
from uav_bt.record.moment import StoredFrame


def label_flights(
    teacher_path: Path,
    records: Sequence[Path],
    plan: UNetPlan,
    folder: Path,
    *,
    every_s: float = 1.0,
    advance: Advance = silent,
) -> tuple[Image, Image]:
    """Label frames of flights with the teacher; flights already done in the folder are kept.

    Args:
        teacher_path: the teacher's weights.
        records: flight records (mcap).
        plan: how masks are sharpened, and their size; its views are not drawn.
        folder: where each flight's result is kept, so that a broken-off run goes on.
        every_s: between two frames of a flight; nearer ones show the same.
        advance: called after every frame.

    Returns:
        Images (N, h, w, 3) and the teacher's ids (N, h, w).

    Raises:
        FileError: a record or the teacher is absent or damaged.
        InputError: there is no frame.
    """
    if not every_s > 0.0:
        raise ValueRangeError(f"the time between two frames must be positive, got {every_s} s")
    teacher = load_teacher(teacher_path)
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
        with np.load(file, allow_pickle=False) as kept:
            return kept["rgb"], kept["ids"]
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
