"""Evaluation of metric depth on a few images of the twin with known depth."""

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from uav_bt.learning.depth_tables.corridors import FOCAL_FACTORS, FRONTS_M, corridor_table
from uav_bt.learning.depth_tables.images import MAP_SIZE_PX, ImagePlan, SampleImage, take_images
from uav_bt.learning.depth_tables.methods import METHODS, Error, methods_for, metric_maps
from uav_bt.learning.depth_tables.tables import (
    DepthQuestions,
    distance_table,
    pair_table,
    sensitivity_table,
)

from perception.camera.ground_plane import ground_depth, view_of
from tests.paper_lab import CARPET, paper_map
from uav_bt.errors import UnknownNameError, ValueRangeError
from uav_bt.learning.evaluation import TABLES, evaluate_depth
from uav_bt.learning.views import DepthViewPlan
from uav_bt.types import ClassMap, DepthMap, Frame

PLAN = ImagePlan(views=DepthViewPlan(scenes=("train-a", "train-b"), views=5, seed=3))
SECRET = 0.37  # metres per unit of the relative depth below


class Grey:
    """Replaces a segmentation network: all pixels are ground."""

    def segment(self, frame: Frame) -> ClassMap:
        return paper_map(
            ids=np.full(MAP_SIZE_PX[::-1], CARPET, dtype=np.uint8), captured_s=frame.captured_s
        )


class Flat:
    """Replaces a depth network: a depth of one everywhere, at another size."""

    def estimate(self, frame: Frame) -> DepthMap:
        ones = np.ones((32, 40), dtype=np.float32)
        return DepthMap(depth=ones, metric=False, captured_s=frame.captured_s)


@pytest.fixture(scope="module")
def raw() -> list[SampleImage]:
    return list(take_images(PLAN, Grey(), Flat()))


def _known(image: SampleImage, *, shift_m: float = 0.0) -> SampleImage:
    """Return an image with exact telemetry, exact masks, and exact depth in a secret unit."""
    relative = DepthMap(
        depth=((image.depth_m - shift_m) / np.float32(SECRET)).astype(np.float32),
        metric=False,
        captured_s=image.frame.captured_s,
    )
    frame = image.frame
    view = view_of(frame, image.camera, MAP_SIZE_PX)
    lever_m = view.height_m - frame.height_above_ground_m
    frame = replace(frame, height_above_ground_m=image.truth.height_m - lever_m)
    exact = image.masks["exact"]
    return replace(image, frame=frame, relative=relative, masks={"unet": exact, "exact": exact})


@pytest.fixture(scope="module")
def known(raw: list[SampleImage]) -> list[SampleImage]:
    return [_known(image) for image in raw]


@pytest.fixture(scope="module")
def questions(known: list[SampleImage]) -> DepthQuestions:
    return DepthQuestions.of(known)


# --- images -------------------------------------------------------------------------------------


def test_the_same_plan_takes_the_same_images_whichever_scenes_stand_beside(
    raw: list[SampleImage],
) -> None:
    alone = replace(PLAN, views=replace(PLAN.views, scenes=("train-b",)))
    for first, second in zip(raw[5:], take_images(alone, Grey(), None), strict=True):
        np.testing.assert_array_equal(first.ids, second.ids)
        np.testing.assert_array_equal(first.frame.image, second.frame.image)
        assert first.frame.height_above_ground_m == second.frame.height_above_ground_m


def test_telemetry_errs_like_a_flight_s_and_no_more(raw: list[SampleImage]) -> None:
    errors_m = [
        view_of(image.frame, image.camera, MAP_SIZE_PX).height_m - image.truth.height_m
        for image in raw
    ]
    assert 0.003 < np.std(errors_m) < 0.06
    assert np.abs(errors_m).max() < 0.12
    assert all(image.frame.attitude.pitch_rad != 0.0 for image in raw)
    assert all(image.frame.gimbal_pitch_rad == image.truth.pitch_rad for image in raw)


def test_an_ideal_profile_has_no_telemetry_error() -> None:
    plan = replace(PLAN, views=replace(PLAN.views, scenes=("train-a",), profile="ideal"))
    errors_m = []
    for image in take_images(plan, Grey(), None):
        view = view_of(image.frame, image.camera, MAP_SIZE_PX)
        assert view.height_m == pytest.approx(image.truth.height_m, abs=1e-6)
        ground = image.ids == CARPET
        errors_m.append(np.abs(ground_depth(view) - image.depth_m)[ground])
    # The exact depth of the ground is then that of the ground plane.
    assert np.percentile(np.concatenate(errors_m), 99) < 0.005


def test_landings_are_left_out(raw: list[SampleImage]) -> None:
    assert len(raw) == 10
    assert min(image.frame.gimbal_pitch_rad for image in raw) > math.radians(-46)


def test_masks_of_another_size_are_refused() -> None:
    class Small(Grey):
        def segment(self, frame: Frame) -> ClassMap:
            return paper_map(ids=np.zeros((9, 16), dtype=np.uint8), captured_s=frame.captured_s)

    with pytest.raises(ValueRangeError, match="224x112 pixels; the masks are 16x9"):
        next(take_images(PLAN, Small(), None))


@pytest.mark.parametrize(
    "bad",
    [
        lambda: ImagePlan(views=DepthViewPlan(scenes=())),
        lambda: ImagePlan(views=DepthViewPlan(views=0)),
    ],
)
def test_plans_without_images_are_refused(bad: Any) -> None:
    with pytest.raises(ValueRangeError, match="a scene and a positive count"):
        bad()


# --- methods --------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["constant", "least_squares", "adaptive", "fused"])
def test_every_scale_finds_the_secret_unit(
    name: str, known: list[SampleImage], questions: DepthQuestions
) -> None:
    method = next(method for method in METHODS if method.name == name)
    maps = metric_maps(method, known, "exact")
    assert questions.distance_errors(maps).valid > 0
    assert questions.distance_errors(maps).median_m < 0.01
    assert questions.pair_errors(maps).mean_m < 0.02


def test_only_least_squares_undoes_a_shift(raw: list[SampleImage]) -> None:
    shifted = [_known(image, shift_m=0.4) for image in raw]
    questions = DepthQuestions.of(shifted)
    errors = {
        row.method: row.error.mean_m
        for row in distance_table(questions, "exact")
        if row.what == "both"
    }
    assert errors["least_squares"] < 0.03
    assert min(errors["constant"], errors["adaptive"]) > 2.0 * errors["least_squares"]


def test_collected_scales_know_all_images_before_the_first(known: list[SampleImage]) -> None:
    """The first image has another unit, which a constant scale must not follow."""
    odd = replace(known[0].relative, depth=2.0 * known[0].relative.depth)
    images = [replace(known[0], relative=odd), *known[1:]]
    constant = next(method for method in METHODS if method.name == "constant")
    first = metric_maps(constant, images, "exact")[0].depth
    assert np.nanmedian(first / known[0].depth_m) == pytest.approx(2.0, rel=0.05)


def test_the_flat_world_ignores_the_network(
    known: list[SampleImage], questions: DepthQuestions
) -> None:
    flat = next(method for method in METHODS if method.name == "flat")
    maps = metric_maps(flat, known, "exact")
    made = [map_.depth for map_ in maps if np.isfinite(map_.depth).any()]
    assert len(made) > 5
    assert all(np.ptp(depth) == 0.0 for depth in made)
    assert questions.distance_errors(maps).mean_m > 0.2


def test_without_a_network_only_the_ways_that_need_none_remain(known: list[SampleImage]) -> None:
    blind = [replace(image, relative=None) for image in known]
    assert [method.name for method in methods_for(blind)] == ["contact", "lowest_pixel", "flat"]
    assert len(methods_for(known)) == len(METHODS)


def test_errors_of_telemetry_add_to_what_the_sensors_say(known: list[SampleImage]) -> None:
    frame = known[0].frame
    wrong = Error(height_m=0.1, pitch_rad=-0.02).on(frame)
    assert wrong.height_above_ground_m == pytest.approx(frame.height_above_ground_m + 0.1)
    assert wrong.gimbal_pitch_rad == pytest.approx(frame.gimbal_pitch_rad - 0.02)
    assert Error(pitch_rad=-9.0).on(frame).gimbal_pitch_rad == -math.pi / 2


# --- tables ---------------------------------------------------------------------------------------


def test_pairs_are_questions_with_every_patch_and_across_faces_without(
    questions: DepthQuestions,
) -> None:
    rows = pair_table(questions, "exact")
    edges = [row for row in rows if not row.across]
    assert {(row.method, row.patch_px) for row in edges} == {
        (method.name, patch) for method in METHODS for patch in (1, 3, 5, 7, 9)
    }
    assert {row.patch_px for row in rows if row.across} == {1}
    assert len({row.error.total for row in edges}) == 1
    assert edges[0].error.total > 10


def test_points_are_split_into_obstacles_and_ground(questions: DepthQuestions) -> None:
    rows = {(row.method, row.what): row.error for row in distance_table(questions, "exact")}
    both, obstacles, ground = (rows["contact", what] for what in ("both", "obstacles", "ground"))
    assert (
        both.total
        == obstacles.total + ground.total
        == sum(len(points.range_m) for points in questions.points)
    )
    assert ground.max_m < 0.05
    assert rows["lowest_pixel", "obstacles"].mean_m > rows["contact", "obstacles"].mean_m


def test_wrong_height_costs_in_proportion_and_masks_make_rows(questions: DepthQuestions) -> None:
    rows = {(row.change, row.method): row.distance for row in sensitivity_table(questions, "exact")}
    assert len({change for change, _ in rows}) == 10
    right = rows["exact masks", "adaptive"].mean_m
    five, ten = (rows[f"height +0.{cm} m", "adaptive"].mean_m for cm in ("05", "10"))
    assert right < five < ten
    # 10 cm of 1.5 m are a fifteenth of each distance.
    assert rows["height +0.10 m", "adaptive"].bias_m == pytest.approx(2.0 * five, rel=0.25)
    assert rows["pitch +2 deg", "contact"].mean_m > rows["pitch +1 deg", "contact"].mean_m


# --- corridor -------------------------------------------------------------------------------------


def test_exact_depth_sees_the_true_corridor(known: list[SampleImage]) -> None:
    rows = corridor_table(known, "exact")
    assert {row.front_m for row in rows} == set(FRONTS_M)
    assert {row.focal_factor for row in rows} == set(FOCAL_FACTORS)
    seen = [row for row in rows if row.method == "adaptive"]
    assert sum(row.intruded for row in seen) > 5
    assert sum(row.clear_misses + row.clear_false_alarms for row in seen) == 0


def test_a_blind_method_misses_every_intrusion(known: list[SampleImage]) -> None:
    far = [
        replace(
            image,
            relative=replace(
                image.relative,
                depth=np.where(image.ids > CARPET, np.float32(100.0), image.relative.depth).astype(
                    np.float32
                ),
            ),
        )
        for image in known
    ]
    for row in corridor_table(far, "exact"):
        if row.method == "adaptive":
            assert row.misses == row.intruded
            assert row.false_alarms == 0
            assert math.isnan(row.nearest_error_m)


def test_images_without_depth_are_no_misses(known: list[SampleImage]) -> None:
    nothing = np.zeros_like(known[0].ids)
    nowhere = [
        replace(image, masks={"unet": replace(image.masks["unet"], ids=nothing)}) for image in known
    ]
    for row in corridor_table(nowhere, "unet"):
        assert row.without_depth == row.images == len(known)
        assert row.misses == row.intruded == 0


# --- all together ---------------------------------------------------------------------------------


def test_a_report_is_plain_values() -> None:
    plan = replace(PLAN, views=replace(PLAN.views, scenes=("train-a",), views=2))
    told: list[tuple[str, int, int]] = []
    result = evaluate_depth(
        plan, Grey(), None, advance=lambda stage, done, total: told.append((stage, done, total))
    )
    assert tuple(result["tables"]) == TABLES
    assert result["images"] == 2
    assert ("images", 2, 2) in told

    def leaves(value: Any) -> Iterator[Any]:
        if isinstance(value, dict | list):
            for part in value.values() if isinstance(value, dict) else value:
                yield from leaves(part)
        else:
            yield value

    assert {type(leaf) for leaf in leaves(result)} <= {str, int, float, bool, type(None)}
    assert all(math.isfinite(leaf) for leaf in leaves(result) if isinstance(leaf, float))


@pytest.mark.parametrize(
    ("tables", "error", "words"),
    [(["pair"], UnknownNameError, "did you mean 'pairs'"), ([], ValueRangeError, "no table")],
)
def test_tables_are_checked_before_any_image_is_taken(
    tables: list[str], error: type[Exception], words: str
) -> None:
    class Never:
        def segment(self, frame: Frame) -> ClassMap:
            raise AssertionError(frame)

    with pytest.raises(error, match=words):
        evaluate_depth(PLAN, Never(), None, tables=tables)
