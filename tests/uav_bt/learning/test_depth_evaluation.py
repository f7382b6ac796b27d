"""Figures against the truth: metric depth, and lengths of a lab in its flights."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Self

import numpy as np
import pytest
from numpy.typing import NDArray

from perception.camera.ground_plane import ground_depth, level_rays, view_of
from perception.depth.scale import GroundSample
from sim_bridge.anafi import anafi_camera
from tests.paper_lab import BACKGROUND, BOXES, CARPET, HELIPAD_BOX, HELIPAD_H, ROOFS, paper_map
from tests.worlds.footage import SeesGround, frame, state, write_record
from uav_bt.errors import FileError
from uav_bt.lab.shipped import load_lab
from uav_bt.landing_marks import MarkSighting, MarkView
from uav_bt.learning import depth_evaluation as evaluation
from uav_bt.learning.flight_geometry import Geometry, compare_ranges, mark_ranges, open_flight
from uav_bt.learning.views import MAP_SIZE_PX, DepthViewPlan, SampleImage, take_images
from uav_bt.types import ClassMap, DepthMap, Frame, LandingMark
from uav_bt.types.arrays import Indices

PLAN = DepthViewPlan(scenes=("train-a", "train-b"), views=5, seed=3)
SECRET = 0.37  # metres per unit of the relative depth below
FACE_M = 2.0


@pytest.fixture(scope="module")
def raw() -> list[SampleImage]:
    return list(take_images(PLAN, "exact", SeesGround(), None))


@pytest.fixture(scope="module")
def ideal() -> list[SampleImage]:
    return list(take_images(replace(PLAN, profile="ideal"), "exact", SeesGround(), None))


def known(images: list[SampleImage]) -> list[SampleImage]:
    """Return images with exact depth in a secret unit."""
    found = []
    for image in images:
        depth = (image.depth_m / SECRET).astype(np.float32)
        relative = DepthMap(depth=depth, metric=False, captured_s=image.frame.captured_s)
        found.append(replace(image, relative=relative))
    return found


def test_a_plan_takes_the_same_images_whichever_scenes_stand_beside(raw: list[SampleImage]) -> None:
    assert len(raw) == 10
    assert min(image.frame.gimbal_pitch_rad for image in raw) > math.radians(-46)  # no landings
    alone = replace(PLAN, scenes=("train-b",))
    for first, second in zip(raw[5:], take_images(alone, "unet", SeesGround(), None), strict=True):
        np.testing.assert_array_equal(first.exact.ids, second.exact.ids)
        np.testing.assert_array_equal(first.frame.image, second.frame.image)
        assert first.frame.height_above_ground_m == second.frame.height_above_ground_m
        assert first.seen is first.exact
        assert (second.seen.ids == CARPET).all()


def ground_errors_m(images: list[SampleImage]) -> NDArray[np.float64]:
    """Return differences of the telemetry's ground plane and the exact ground, by image."""
    errors = []
    for image in images:
        plane_m = ground_depth(view_of(image.frame, evaluation.MAP_CAMERA, MAP_SIZE_PX))
        ground = (image.exact.ids == CARPET) & np.isfinite(plane_m)
        if ground.sum() > 100:
            errors.append(np.median((plane_m - image.depth_m)[ground] / image.depth_m[ground]))
    return np.array(errors)


def test_telemetry_errs_like_that_of_a_flight_and_not_in_an_ideal_one(
    raw: list[SampleImage], ideal: list[SampleImage]
) -> None:
    assert 0.002 < np.std(ground_errors_m(raw)) < 0.06
    assert np.abs(ground_errors_m(ideal)).max() < 0.003
    assert all(image.frame.attitude.pitch_rad != 0.0 for image in ideal)


class Scenery:
    """A class map and its depth, painted by rectangles that face the camera."""

    def __init__(self) -> None:
        self.ids: NDArray[np.uint8] = np.full((112, 224), BACKGROUND, dtype=np.uint8)
        self.depth: NDArray[np.float32] = np.full((112, 224), 6.0, dtype=np.float32)

    def paint(self, thing: int, rows: slice, columns: slice, depth_m: float = FACE_M) -> Self:
        self.ids[rows, columns] = thing
        self.depth[rows, columns] = depth_m
        return self

    def pick(self, seed: int = 0) -> Indices:
        return evaluation.pick_edges(paper_map(self.ids), self.depth, np.random.default_rng(seed))

    def draw(self) -> tuple[Indices, Indices]:
        return evaluation.draw_points(paper_map(self.ids), self.depth, np.random.default_rng(0))


def one_face() -> Scenery:
    return Scenery().paint(BOXES[0], np.s_[20:81], np.s_[80:141])


def test_lengths_of_edges() -> None:
    scenery = one_face()
    edges = scenery.pick()
    lengths = evaluation.edge_lengths(scenery.depth, edges)
    camera = evaluation.MAP_CAMERA
    expected = sorted(56 / focal_px * FACE_M for focal_px in 2 * (camera.fx_px, camera.fy_px))
    np.testing.assert_allclose(sorted(lengths), expected, rtol=1e-6)
    np.testing.assert_allclose(evaluation.edge_lengths(2.0 * scenery.depth, edges), 2.0 * lengths)
    scenery.depth[22, 82] = np.nan
    assert np.isnan(evaluation.edge_lengths(scenery.depth, edges)).sum() == 2


LEFT, RIGHT, LOW_RIGHT, LOW_LEFT = (82, 22), (138, 22), (138, 78), (82, 78)
UPPER, TALL, WIDE = np.s_[:81], np.s_[20:81], np.s_[80:141]


@pytest.mark.parametrize(
    ("scenery", "kept"),
    [
        (one_face(), {LEFT, RIGHT, LOW_RIGHT, LOW_LEFT}),
        (Scenery().paint(BOXES[0], UPPER, WIDE), {LOW_LEFT, LOW_RIGHT}),  # cut off
        # Behind another obstacle, and behind nearer ground, which hides nothing.
        (one_face().paint(HELIPAD_BOX, np.s_[60:], np.s_[120:200], 1.0), {LEFT, RIGHT, LOW_LEFT}),
        (one_face().paint(CARPET, np.s_[81:], np.s_[:], 1.5), {LEFT, RIGHT, LOW_RIGHT, LOW_LEFT}),
        (Scenery().paint(CARPET, TALL, WIDE), set()),
        (Scenery().paint(HELIPAD_BOX, TALL, WIDE), set()),
        (Scenery().paint(BOXES[2], np.s_[20:27], np.s_[80:87]), set()),  # a speck
        (Scenery().paint(BOXES[2], np.s_[20:25], WIDE), set()),  # shrinks to a line
    ],
)
def test_visible_corners_are_picked(scenery: Scenery, kept: set[tuple[int, int]]) -> None:
    assert {tuple(corner) for corner in scenery.pick().reshape(-1, 2).tolist()} == kept


def test_eight_edges_at_most_and_another_seed_picks_others() -> None:
    scenery = one_face().paint(ROOFS[0], np.s_[4:20], np.s_[80:141], FACE_M + 0.1)
    for at in (10, 180):
        scenery.paint(BOXES[0], np.s_[20:60], np.s_[at : at + 40])
    picks = [scenery.pick(seed) for seed in (0, 1, 2, 3, 3)]
    assert {len(edges) for edges in picks} == {8}
    assert len({edges.tobytes() for edges in picks}) > 1
    np.testing.assert_array_equal(picks[3], picks[4])


def test_points_lie_inside_obstacles_and_ground_within_reach() -> None:
    scenery = Scenery().paint(BACKGROUND, np.s_[:], np.s_[:])
    scenery.paint(BOXES[3], np.s_[20:60], np.s_[30:90]).paint(CARPET, np.s_[60:], np.s_[:])
    rows, columns = scenery.draw()
    own = scenery.ids[rows, columns]
    assert [int((own == one).sum()) for one in (BOXES[3], CARPET)] == [40, 40]
    for step in (-2, 2):
        assert (scenery.ids[np.minimum(rows + step, 111), columns] == own).all()
        assert (scenery.ids[rows, np.clip(columns + step, 0, 223)] == own).all()
    for depth_m in (0.1, 7.0):
        scenery.depth[:] = depth_m
        assert scenery.draw()[0].size == 0


def off_m(name: str, images: list[SampleImage]) -> float:
    """Return the median error of a method's depth within reach."""
    maps = list(evaluation.metric_maps(name, images))
    errors = [
        np.abs(depth - image.depth_m)[image.depth_m < 5.0]
        for depth, image in zip(maps, images, strict=True)
    ]
    return float(np.nanmedian(np.concatenate(errors)))


@pytest.mark.parametrize("name", ["constant", "least_squares", "adaptive", "flown"])
def test_every_scale_finds_the_secret_unit(name: str, ideal: list[SampleImage]) -> None:
    assert off_m(name, known(ideal)) < 0.02


def test_collected_scales_know_all_images_before_the_first(ideal: list[SampleImage]) -> None:
    """The first image has another unit, which a constant scale must not follow."""
    first, *others = known(ideal)
    assert first.relative is not None
    odd = replace(first.relative, depth=2.0 * first.relative.depth)
    depth = next(evaluation.metric_maps("constant", [replace(first, relative=odd), *others]))
    assert np.nanmedian(depth / first.depth_m) == pytest.approx(2.0, rel=0.05)


def sample(known_m: float, predicted: float) -> GroundSample:
    return GroundSample(
        known_m=np.full(3, known_m, np.float32), predicted=np.full(3, predicted, np.float32)
    )


def test_least_squares_finds_scale_and_shift() -> None:
    estimator = evaluation.collected_scale("least_squares")
    for given in (0.5, 1.0, 3.0):
        scale = estimator(sample(2.0 * given - 0.1, given), 0.0, None)
    assert scale is not None
    assert (scale.factor, scale.shift_m) == pytest.approx((2.0, -0.1), rel=1e-4)


def test_frames_that_are_alike_have_no_shift() -> None:
    for method in ("constant", "least_squares"):
        estimator = evaluation.collected_scale(method)
        assert estimator(None, 0.0, None) is None
        for known_m in (1.0, 1.1, 30.0):
            scale = estimator(sample(known_m, 0.5), 0.0, None)
        assert scale is not None
        assert (scale.factor, scale.shift_m) == (pytest.approx(2.2), 0.0)


def test_figures_are_those_worked_out_by_hand() -> None:
    estimated, truth = [1.1, np.nan, 2.3, 2.8, 4.0], [1.0, 9.0, 2.0, 3.0, 4.0]
    summary = evaluation.summarise_errors(np.array(estimated), np.array(truth))
    known_m = [1.1, 2.3, 2.8, 4.0], [1.0, 2.0, 3.0, 4.0]
    assert summary == {
        "total": 5,
        "valid": 4,
        "mean_m": pytest.approx(0.15),
        "median_m": pytest.approx(0.15),
        "rmse_m": pytest.approx(math.sqrt(0.14 / 4), abs=1e-5),
        "std_m": pytest.approx(math.sqrt(0.14 / 4 - 0.15**2), abs=1e-5),
        "max_m": pytest.approx(0.3),
        "correlation": pytest.approx(np.corrcoef(*known_m)[0, 1], abs=1e-5),
    }


def test_without_any_estimate_the_figures_are_unknown() -> None:
    for count in (0, 3):
        summary = evaluation.summarise_errors(np.full(count, np.nan), np.ones(count))
        assert (summary["total"], summary["valid"]) == (count, 0)
        assert summary["mean_m"] is summary["correlation"] is None
    never = evaluation.summarise_errors(np.array([2.0, 2.0]), np.array([1.0, 3.0]))
    assert never["correlation"] is None


# --- lengths of a lab in its flights --------------------------------------------------------------

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


def test_records_without_frames_are_refused(tmp_path: Path) -> None:
    for frames in ([], [shot(0, height_m=math.nan)]):
        with pytest.raises(FileError, match="has no frame with an image, height and gimbal pitch"):
            flown(tmp_path, frames)
