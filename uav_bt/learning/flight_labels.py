"""Pictures of recorded flights with the teacher's masks: what the U-Net learns from a real lab."""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

from perception.segmentation.refine import refined_ids
from perception.segmentation.teacher import Teacher, load_teacher
from uav_bt.errors import InputError, ValueRangeError
from uav_bt.learning.dataset.images import PictureStore
from uav_bt.learning.dataset.index_file import flight_data
from uav_bt.learning.dataset.windows import thinned
from uav_bt.learning.segmentation import StudentPlan
from uav_bt.learning.views import Image
from uav_bt.progress import Advance, silent

__all__ = ["label_flights"]


def label_flights(
    teacher_path: Path,
    records: Sequence[Path],
    plan: StudentPlan,
    folder: Path,
    *,
    every_s: float = 1.0,
    advance: Advance = silent,
) -> tuple[Image, Image]:
    """Let the teacher label pictures of flights; flights already done in the folder are kept.

    Args:
        teacher_path: the teacher's weights.
        records: flight records (mcap).
        plan: how masks are sharpened, and their size; its views are not drawn.
        folder: where each flight's result is kept, so that a broken-off run goes on.
        every_s: between two pictures of a flight; nearer ones show the same.
        advance: told after every picture.

    Returns:
        Pictures (N, h, w, 3) and the teacher's ids (N, h, w).

    Raises:
        FileError: a record or the teacher is absent or damaged.
        InputError: there is no picture.
    """
    if not every_s > 0.0:
        raise ValueRangeError(f"the time between two pictures must be positive, got {every_s} s")
    teacher = load_teacher(teacher_path)
    folder.mkdir(parents=True, exist_ok=True)
    parts = [
        _labelled(teacher, record, plan, folder, every_s=every_s, advance=advance)
        for record in records
    ]
    if not any(len(rgb) for rgb, _ in parts):
        raise InputError("there is no picture in these flights to learn from")
    return np.concatenate([rgb for rgb, _ in parts]), np.concatenate([ids for _, ids in parts])


def _labelled(
    teacher: Teacher,
    record: Path,
    plan: StudentPlan,
    folder: Path,
    *,
    every_s: float,
    advance: Advance,
) -> tuple[Image, Image]:
    flight = flight_data(record)
    about = zlib.crc32(flight.stored_ns.tobytes() + np.float64(every_s).tobytes())
    file = folder / f"labels-{record.stem}-{about:08x}.npz"
    if file.is_file():
        with np.load(file, allow_pickle=False) as kept:
            return kept["rgb"], kept["ids"]
    store = PictureStore((teacher.config.width_px, teacher.config.height_px), keep=1)
    places = thinned(flight.captured_s, every_s)
    width, height = plan.size_px
    rgbs = np.zeros((len(places), height, width, 3), dtype=np.uint8)
    ids = np.zeros((len(places), height, width), dtype=np.uint8)
    for done, place in enumerate(places):
        picture = store.picture(flight, int(place))
        mask = refined_ids(teacher, picture, plan.refine)
        rgbs[done] = cv2.resize(picture, plan.size_px, interpolation=cv2.INTER_AREA)
        ids[done] = cv2.resize(mask, plan.size_px, interpolation=cv2.INTER_NEAREST_EXACT)
        advance(f"labels, {record.stem}", done + 1, len(places))
    partial = file.with_suffix(".part.npz")
    np.savez_compressed(partial, rgb=rgbs, ids=ids)
    partial.replace(file)
    return rgbs, ids
