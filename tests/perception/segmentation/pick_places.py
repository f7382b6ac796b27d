"""A place whose classes have clear colours, for tests of picks."""

from pathlib import Path
from typing import Final

import cv2
import numpy as np

from perception.segmentation.training.pick_session import PickSession
from uav_bt.lab.classes import LabClass, LabClasses

FLOOR, CRATE, PAD = (40, 160, 60), (200, 40, 40), (240, 240, 240)
PLACE: Final = LabClasses(
    [
        LabClass(name="wall", role="outside", colour=(40, 40, 48)),
        LabClass(name="floor", role="ground", colour=(126, 158, 120)),
        LabClass(name="crate", role="obstacle", colour=(214, 39, 40)),
        LabClass(name="pad", role="mark", colour=(255, 255, 255)),
    ]
)


def write_image(path: Path, *colours: tuple[int, int, int], seed: int = 0) -> None:
    """Write an image of 160x90 with stripes of colours, from left to right."""
    rgb = np.zeros((90, 160, 3), dtype=np.uint8)
    for number, part in enumerate(np.array_split(np.arange(160), len(colours))):
        rgb[:, part] = colours[number]
    rgb += np.random.default_rng(seed).integers(0, 10, rgb.shape, dtype=np.uint8)
    path.parent.mkdir(exist_ok=True)
    cv2.imwrite(str(path), cv2.cvtColor(rgb, cv2.COLOR_RGB2BGR))


def session_of(folder: Path, uses: dict[str, str]) -> PickSession:
    """Return a session with the images of `folder/frames`."""
    return PickSession(folder / "frames", folder / "picks.csv", PLACE, uses)
