"""Small made-up pictures in which colour tells the class, for the segmentation's tests."""

from collections.abc import Iterator
from functools import cache

import numpy as np

from perception.segmentation.teacher import Teacher, TeacherConfig, fit_teacher
from perception.segmentation.training.picks import PickedPatches, draw_picks, gather_patches
from tests.paper_lab import BACKGROUND, BOXES, CARPET, CLASSES, HELIPAD_BOX, HELIPAD_H
from uav_bt.types.arrays import Image

_COLOURS = {
    BACKGROUND: ((120, 120, 120), (128, 128, 124)),
    CARPET: ((60, 110, 140), (90, 150, 170)),
    HELIPAD_H: ((10, 70, 45), (240, 245, 240)),
    HELIPAD_BOX: ((245, 205, 20), (205, 25, 20)),
    BOXES[0]: ((205, 40, 150), (250, 220, 240)),
    BOXES[2]: ((30, 60, 180), (140, 190, 245)),
}
PATTERNED = tuple(_COLOURS)
CONFIG = TeacherConfig(width_px=160, height_px=90, patch_px=12)


def paint(ids: Image, rng: np.random.Generator) -> Image:
    """Return a picture whose pixels take one of their class's two colours, with noise."""
    coin = rng.integers(2, size=ids.shape)
    table = np.zeros((17, 2, 3))
    for class_id, pair in _COLOURS.items():
        table[class_id] = pair
    noisy = table[ids, coin] + rng.normal(0.0, 3.0, (*ids.shape, 3))
    return np.clip(np.round(noisy), 0, 255).astype(np.uint8)


def layout(rng: np.random.Generator, width: int, height: int) -> Image:
    """Return a map: wall above, ground below, two boxes and a pad with its H."""
    ids = np.full((height, width), BACKGROUND, dtype=np.uint8)
    ids[height // 3 :] = CARPET
    side = height // 3
    for class_id in (BOXES[0], BOXES[2], HELIPAD_BOX):
        x, y = int(rng.integers(width - side)), int(rng.integers(height - side))
        ids[y : y + side, x : x + side] = class_id
        if class_id == HELIPAD_BOX:
            inner = side // 5
            ids[y + inner : y + side - inner, x + inner : x + side - inner] = HELIPAD_H
    return ids


def samples(
    count: int, *, seed: int, width: int = 160, height: int = 90
) -> Iterator[tuple[str, Image, Image]]:
    """Yield names, pictures and exact ids."""
    rng = np.random.default_rng(seed)
    for index in range(count):
        ids = layout(rng, width, height)
        yield f"{index}.png", paint(ids, rng), ids


@cache
def patches(config: TeacherConfig = CONFIG) -> PickedPatches:
    """Return patches of twelve pictures of the teacher's size."""
    size = {"width": config.width_px, "height": config.height_px}
    exact = ((name, ids) for name, _, ids in samples(12, seed=1, **size))
    rng = np.random.default_rng(0)
    drawn = draw_picks(exact, rng, patch_px=config.patch_px, total=600)
    images = ((name, rgb) for name, rgb, _ in samples(12, seed=1, **size))
    return gather_patches(drawn, images, config.patch_px, CLASSES)


@cache
def teacher(config: TeacherConfig = CONFIG) -> Teacher:
    """Return a teacher of these patches."""
    return fit_teacher(patches(config), config)
