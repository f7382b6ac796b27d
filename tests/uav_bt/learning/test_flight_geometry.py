"""Lengths of a lab in its flights: agreement, wrong figures, and refusals."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest

from perception.camera.ground_plane import ground_depth, level_rays, view_of
from sim_bridge.anafi import anafi_camera
from tests.paper_lab import BACKGROUND, CARPET, HELIPAD_BOX, HELIPAD_H, paper_map
from tests.worlds.footage import frame, state, write_record
from uav_bt.errors import FileError
from uav_bt.lab.lab import Lab
from uav_bt.lab.shipped import load_lab
from uav_bt.landing_marks import MarkSighting, MarkView
from uav_bt.learning.flight_geometry import (
    Geometry,
    MarkRanges,
    compare_lengths,
    mark_ranges,
    open_flight,
)
from uav_bt.types import ClassMap, DepthMap, Frame, LandingMark

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


class Exact:
    """A depth network whose unit is 2 m, exact on ground and mark."""

    def estimate(self, frame: Frame) -> DepthMap:
        view = replace(view_of(frame, CAMERA, SIZE), height_m=1.5)
        on_mark = Painted().segment(frame).ids == HELIPAD_H
        depth = np.where(on_mark, ground_depth(view, plane_m=0.4), ground_depth(view))
        depth = np.where(np.isfinite(depth), 0.5 * depth, 4.0).astype(np.float32)
        return DepthMap(depth=depth, metric=False, captured_s=frame.captured_s)


def shot(index: int, **changes: float) -> Frame:
    image = np.random.default_rng(index).integers(40, 200, (180, 320, 3), dtype=np.uint8)
    return frame(image, index, index / 2, **({"gimbal_pitch_rad": PITCH_RAD} | changes))


def flown(tmp_path: Path, frames: Sequence[Frame], mark: LandingMark = MARK) -> Geometry:
    path = write_record(tmp_path / "flight.mcap", CAMERA, frames, [state(0.0)])
    lab = replace(load_lab(), mark=mark)
    return compare_lengths([open_flight(path, lab)], lab, Painted(), Exact())


def test_right_figures_agree_and_name_no_cause(tmp_path: Path) -> None:
    found = flown(tmp_path, [shot(index) for index in range(8)])
    assert found.frames == 4  # a second apart
    assert found.ground_error(90) < 0.01
    assert len(found.marks) == 4
    for of in ("by_size", "by_height"):
        assert found.ratio(of, "by_depth") == pytest.approx(1.0, abs=0.03)
    assert found.likely_wrong(FILE) == ""
    lines = list(found.lines())
    assert lines[0] == "geometry in 4 frames of flights"
    assert "  mark in 4 frames: the range by its size is " in lines[2]
    assert json.loads(json.dumps(found.to_json()))["marks"] == 4


@pytest.mark.parametrize(
    ("mark", "height_m", "cause"),
    [
        (replace(MARK, length_m=0.8, width_m=0.8), 1.5, "size of the mark in lab.yaml (too large)"),
        (replace(MARK, height_m=0.1), 1.5, "height_m of the mark in lab.yaml (too small)"),
        (MARK, 1.9, "the height of the drone (too large)"),
    ],
)
def test_a_wrong_figure_is_named(
    tmp_path: Path, mark: LandingMark, height_m: float, cause: str
) -> None:
    frames = [shot(2 * index, height_m=height_m) for index in range(3)]
    found = flown(tmp_path, frames, mark)
    assert found.ground_error(50) < 0.01  # the scale takes the wrong height
    line = found.likely_wrong(FILE)
    assert line.startswith("likely wrong: ")
    assert cause in line


def test_a_depth_network_that_does_not_know_the_place_is_no_fault_of_the_lab() -> None:
    found = Geometry(ground_errors=[np.full(9, 0.3)])
    found.marks += 3 * [MarkRanges(by_size=2.0, by_height=2.0, by_depth=1.2)]
    assert "the depth network" in found.likely_wrong(FILE)
    found.marks[:] = 3 * [MarkRanges(by_size=2.0, by_height=1.6, by_depth=1.2)]
    assert "size or height_m of the mark" in found.likely_wrong(FILE)
    found.marks.pop()
    assert found.likely_wrong(FILE) == ""


def test_a_frame_without_ground_has_no_scale_of_an_earlier_one(tmp_path: Path) -> None:
    level = [shot(4, gimbal_pitch_rad=1.0), shot(6, height_m=0.1)]
    found = flown(tmp_path, [shot(0), shot(2), *level])
    assert found.refusals == {
        "no scale: too little ground": 1,
        "no height above the ground": 1,
    }
    assert "  without metric depth: 50.0 % of the frames" in "\n".join(found.lines())


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
    found = mark_ranges(view, MARK, Tagged(), None)
    assert found is not None
    assert found.by_size == pytest.approx(2.0)
    assert found.by_height == pytest.approx(1.6, abs=0.02)
    assert math.isnan(found.by_depth)


def refusal(path: Path, lab: Lab) -> str:
    with pytest.raises(FileError) as refused:
        compare_lengths([open_flight(path, lab)], lab, Painted(), Exact())
    return str(refused.value)


def test_records_of_other_labs_or_without_frames_are_refused(tmp_path: Path) -> None:
    lab, path = load_lab(), tmp_path / "flight.mcap"
    write_record(path, CAMERA, [shot(0)], [state(0.0)], facts={"lab": "depot"})
    assert "was flown in the lab 'depot', not in 'paper'" in refusal(path, lab)
    classes = json.dumps([asdict(each) for each in list(lab.classes)[:4]], default=list)
    facts = {"lab": "paper", "classes": classes}
    write_record(path, CAMERA, [shot(0)], [state(0.0)], facts=facts)
    assert "expected the classes of " in refusal(path, lab)
    write_record(path, CAMERA, [], [state(0.0)])
    assert "has no frame with an image, height and gimbal pitch" in refusal(path, lab)
    write_record(path, CAMERA, [shot(0, height_m=math.nan)], [state(0.0)])
    assert "has no frame with an image, height and gimbal pitch" in refusal(path, lab)
