"""Lengths of a lab in its flights: agreement, wrong figures, and refusals."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from perception.camera.ground_plane import ground_depth, level_rays, view_of
from sim_bridge.anafi import anafi_camera
from tests.paper_lab import BACKGROUND, CARPET, HELIPAD_BOX, HELIPAD_H, paper_map
from tests.worlds.footage import frame, state, write_record
from uav_bt.errors import FileError
from uav_bt.lab.shipped import load_lab
from uav_bt.landing_marks import MarkSighting, MarkView
from uav_bt.learning.flight_geometry import Geometry, compare_ranges, mark_ranges, open_flight
from uav_bt.types import ClassMap, Frame, LandingMark

SIZE = (224, 112)
CAMERA = anafi_camera(320, 180)
PITCH_RAD = math.radians(-35.0)
MARK = LandingMark(length_m=0.6, width_m=0.6, height_m=0.4)
FILE = Path("lab.yaml")


class Painted:
    """A segmenter that paints the panel of a mark 1.6 m ahead of the lens, as seen from 1.5 m."""

    def segment(self, frame: Frame) -> ClassMap:
        view = replace(view_of(frame, CAMERA, SIZE), height_m=1.5)
        near = ground_depth(view) < 6.0
        forward_m, right_m, _ = level_rays(view) * ground_depth(view, plane_m=MARK.height_m)
        off_m = np.maximum(abs(forward_m - 1.6), abs(right_m))
        ids = np.where(near, CARPET, BACKGROUND).astype(np.uint8)
        ids[off_m < 0.3] = HELIPAD_BOX
        ids[off_m < 0.3 * math.sqrt(0.6)] = HELIPAD_H
        return paper_map(ids=ids, captured_s=frame.captured_s)


def shot(index: int, **changes: float) -> Frame:
    image = np.random.default_rng(index).integers(40, 200, (180, 320, 3), dtype=np.uint8)
    return frame(image, index, index / 2, **({"gimbal_pitch_rad": PITCH_RAD} | changes))


def flown(tmp_path: Path, frames: Sequence[Frame], mark: LandingMark = MARK) -> Geometry:
    path = write_record(tmp_path / "flight.mcap", CAMERA, frames, [state(0.0)])
    lab = replace(load_lab(), mark=mark)
    return compare_ranges([open_flight(path, lab)], lab, Painted())


def test_right_figures_agree_and_name_no_cause(tmp_path: Path) -> None:
    found = flown(tmp_path, [shot(index) for index in range(8)])
    assert found.frames == len(found.ratios) == 4  # a second apart
    assert found.ratio == pytest.approx(1.0, abs=0.03)
    heading, line = found.lines(FILE)
    assert heading == "geometry in 4 frames of flights"
    assert line.startswith("  mark in 4 frames: the range by its size is ")
    assert json.loads(json.dumps(found.to_json()))["marks"] == 4


@pytest.mark.parametrize(
    ("mark", "height_m", "large"),
    [
        (replace(MARK, length_m=0.8, width_m=0.8), 1.5, "large"),
        (replace(MARK, height_m=0.1), 1.5, "small"),
        (MARK, 1.9, "small"),
    ],
)
def test_a_wrong_figure_is_named(
    tmp_path: Path, mark: LandingMark, height_m: float, large: str
) -> None:
    frames = [shot(2 * index, height_m=height_m) for index in range(3)]
    *_, line = flown(tmp_path, frames, mark).lines(FILE)
    assert line.startswith(f"likely wrong: size or height_m of the mark in lab.yaml (too {large})")


def test_few_or_no_marks_name_no_cause(tmp_path: Path) -> None:
    few = Geometry(frames=2, ratios=[1.4, 1.4])
    assert len(list(few.lines(FILE))) == 2
    level = flown(tmp_path, [shot(0, gimbal_pitch_rad=1.0)])
    assert list(level.lines(FILE))[1].startswith("  mark: in no frame found")
    assert level.to_json() == {"frames": 1, "marks": 0, "size_to_height": None}


class Tagged:
    """A finder that measures the mark 2 m before the body."""

    uses_images, shows_heading = True, True

    def find(self, view: MarkView) -> MarkSighting:
        forward_m = 2.0 + view.camera.forward_offset_m
        return MarkSighting(forward_m=forward_m, right_m=0.0, height_m=0.4)

    def picture(self) -> None:
        return None


def test_the_range_of_tags_is_that_of_their_size() -> None:
    view = MarkView(frame=shot(0), camera=CAMERA, class_map=Painted().segment(shot(0)))
    assert mark_ranges(view, MARK, Tagged()) == (pytest.approx(2.0), pytest.approx(1.6, abs=0.02))


def test_records_of_other_labs_or_without_frames_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "flight.mcap"
    write_record(path, CAMERA, [shot(0)], [state(0.0)], facts={"lab": "depot"})
    with pytest.raises(FileError, match="was flown in the lab 'depot', not in 'paper'"):
        open_flight(path, load_lab())
    for frames in ([], [shot(0, height_m=math.nan)]):
        with pytest.raises(FileError, match="has no frame with an image, height and gimbal pitch"):
            flown(tmp_path, frames)
