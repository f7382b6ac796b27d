"""Score the network `any` on photographs of real rooms, whose floor was marked by eye.

    python -m benchmarks.real_rooms                                # seven views of two buildings
    python -m benchmarks.real_rooms FOLDER --picture rooms.webp    # your photographs and floor.json

Recall is the share of the floor that the network calls ground, precision the share of the pixels
called ground that are floor. The total pools all views. README.md beside describes floor.json.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final

import cv2
import numpy as np
from pydantic import Field

from benchmarks.segmentation import load_network
from perception.camera.image_files import read_image
from uav_bt.display import canvas
from uav_bt.display.video.panes import draw_class_map
from uav_bt.errors import FileError, InputError, ValueRangeError
from uav_bt.files import check_output, write_whole
from uav_bt.inputs import refuse_inputs
from uav_bt.lab.classes import GROUND, LabClasses
from uav_bt.types import ClassMap, Frame
from uav_bt.yaml_file import read_yaml

HERE: Final = Path(__file__).parent
BAND: Final = 0.06  # above and below the line, as a share of the height: neither floor nor other
PANE_PX: Final = (480, 270)
Share = Annotated[float, Field(ge=0.0, le=1.0)]  # of the width or height


@dataclass(frozen=True, kw_only=True)
class FloorMarks:
    """Where the floor of a photograph is: below the line, without the boxes of obstacles."""

    line: list[tuple[Share, Share]]  # x, y
    obstacles: tuple[tuple[Share, Share, Share, Share], ...] = ()  # left, top, right, bottom

    def __post_init__(self) -> None:
        columns = [x for x, _ in self.line]
        if columns != sorted(set(columns)) or columns[:1] + columns[-1:] != [0.0, 1.0]:
            raise ValueRangeError(f"line: expected x to rise from 0 to 1, got {columns}")
        if any(box[0] >= box[2] or box[1] >= box[3] for box in self.obstacles):
            raise ValueRangeError("obstacles: expected left, top, right and bottom of each box")

    def count(self, seen: ClassMap) -> list[int]:
        """Count pixels: floor called ground, floor not called ground, others called ground."""
        ground = seen.roles == GROUND
        y, x = ((np.arange(size) + 0.5) / size for size in ground.shape)
        below = y[:, None] - np.interp(x, *np.transpose(self.line))
        for left, top, right, bottom in self.obstacles:
            below[np.ix_((y >= top) & (y <= bottom), (x >= left) & (x <= right))] = -1.0
        floor, other = below > BAND, below < -BAND
        return [int(each.sum()) for each in (floor & ground, floor & ~ground, other & ground)]


def describe(*counts: list[int]) -> str:
    """Return recall and precision of one or more views as text; a share of nothing is `-`."""
    found, *others = map(sum, zip(*counts, strict=True))
    shares = (f"{found / (found + other):.3f}" if found + other else "-" for other in others)
    return "recall {}, precision {}".format(*shares)


def score(folder: Path, picture: Path | None) -> None:
    """Print the scores of a folder, and write the picture of three views."""
    file = read_yaml(folder / "floor.json", dict[str, FloorMarks], "file of floor lines")
    if not file.value:
        raise file.error("expected photographs with the line of their floor, got none")
    if picture is not None:
        if picture.suffix != ".webp":
            raise FileError(picture, "expected a name that ends in .webp")
        check_output(picture)
        refuse_inputs(picture, [file.path], folder)
    network, views = load_network("any", LabClasses.by_role()), []
    for name, marks in file.value.items():
        image = read_image(folder / name, colour=True, as_stored=False)
        seen = network.segment(Frame(image=image, index=0, captured_s=0.0, gimbal_pitch_rad=0.0))
        counts, photograph = marks.count(seen), canvas.resized(image, PANE_PX, cv2.INTER_AREA)
        print(line := f"{name}: {describe(counts)}", flush=True)
        canvas.line(photograph, np.multiply(marks.line, PANE_PX), canvas.ACCENT, 2)
        canvas.tag(photograph, line, (8, 8))
        views.append((counts, np.vstack([photograph, draw_class_map(seen, PANE_PX)])))
    print(f"total of {len(views)} views: {describe(*(counts for counts, _ in views))}")
    if picture is not None:
        views.sort(key=lambda view: view[0][0] / max(sum(view[0]), 1), reverse=True)
        shown = np.hstack([views[at][1] for at in sorted({0, len(views) // 2, len(views) - 1})])
        webp = cv2.imencode(".webp", shown[..., ::-1], [cv2.IMWRITE_WEBP_QUALITY, 75])[1]
        write_whole(picture, webp.tobytes())


def main(arguments: list[str] | None = None) -> None:
    """Print the scores; an input that cannot be used ends with one message."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("folder", nargs="?", type=Path, default=HERE, help="photos, floor.json")
    parser.add_argument("--picture", type=Path, help="WebP file of best, middle and worst view")
    given = parser.parse_args(arguments)
    try:
        score(given.folder, given.picture)
    except InputError as error:
        parser.error(str(error))


if __name__ == "__main__":
    main()
