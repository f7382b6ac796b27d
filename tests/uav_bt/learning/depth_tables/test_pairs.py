"""Points and their pairs: which are picked, what depth maps give them, and the errors."""

import math
from typing import Self

import numpy as np
import pytest
from numpy.typing import NDArray
from uav_bt.learning.depth_tables.pairs import (
    PointPairs,
    draw_points,
    pair_distances,
    pick_pairs,
    ranges_at,
    summarise_errors,
)

from tests.paper_lab import BACKGROUND, BOXES, CARPET, HELIPAD_BOX, ROOFS, paper_map
from uav_bt.types import CameraModel

CAMERA = CameraModel(width_px=224, height_px=112, fx_px=160.0, fy_px=150.0, cx_px=111.5, cy_px=55.5)
FACE_M = 2.0


class Scenery:
    """A class map and its depth, painted by rectangles that face the camera."""

    def __init__(self) -> None:
        self.ids: NDArray[np.uint8] = np.full((112, 224), BACKGROUND, dtype=np.uint8)
        self.depth: NDArray[np.float32] = np.full((112, 224), 6.0, dtype=np.float32)

    def paint(self, thing: int, rows: slice, columns: slice, depth_m: float = FACE_M) -> Self:
        self.ids[rows, columns] = thing
        self.depth[rows, columns] = depth_m
        return self

    def pick(self, seed: int = 0) -> PointPairs:
        return pick_pairs(paper_map(self.ids), self.depth, CAMERA, np.random.default_rng(seed))


def one_face() -> Scenery:
    return Scenery().paint(BOXES[0], np.s_[20:81], np.s_[80:141])


def corners(pairs: PointPairs) -> set[tuple[int, int]]:
    return {(int(x), int(y)) for x, y in np.concatenate([pairs.first, pairs.second])}


def test_the_edges_of_a_face_span_its_corners_two_pixels_inside() -> None:
    scenery = one_face()
    pairs = scenery.pick()
    assert corners(pairs) == {(82, 22), (138, 22), (138, 78), (82, 78)}
    assert not pairs.across.any()
    lengths = pair_distances(scenery.depth, pairs, CAMERA)
    across, upright = 56 / CAMERA.fx_px * FACE_M, 56 / CAMERA.fy_px * FACE_M
    np.testing.assert_allclose(sorted(lengths), [across, across, upright, upright], rtol=1e-6)
    np.testing.assert_allclose(pair_distances(2.0 * scenery.depth, pairs, CAMERA), 2.0 * lengths)


@pytest.mark.parametrize(
    ("scenery", "kept"),
    [
        pytest.param(
            Scenery().paint(BOXES[0], np.s_[:81], np.s_[80:141]),
            {(82, 78), (138, 78)},
            id="a face that the image cuts off",
        ),
        pytest.param(
            one_face().paint(HELIPAD_BOX, np.s_[60:112], np.s_[120:200], 1.0),
            {(82, 22), (138, 22), (82, 78)},
            id="a corner that a nearer object makes",
        ),
        *(
            pytest.param(
                one_face().paint(thing, np.s_[81:], np.s_[:], 1.5),
                {(82, 22), (138, 22), (138, 78), (82, 78)},
                id=f"nearer ground hides no base, {thing}",
            )
            for thing in (CARPET, BACKGROUND)
        ),
        *(
            pytest.param(Scenery().paint(thing, rows, columns), set(), id=name)
            for name, thing, rows, columns in (
                ("ground", CARPET, np.s_[20:81], np.s_[80:141]),
                ("background", BACKGROUND, np.s_[20:81], np.s_[80:141]),
                ("mark", HELIPAD_BOX, np.s_[20:81], np.s_[80:141]),
                ("a speck", BOXES[2], np.s_[20:27], np.s_[80:87]),
                ("a strip that shrinks to a line", BOXES[2], np.s_[20:25], np.s_[80:141]),
            )
        ),
    ],
)
def test_corners_of_obstacles_are_picked_where_they_are_theirs(
    scenery: Scenery, kept: set[tuple[int, int]]
) -> None:
    assert corners(scenery.pick()) == kept


def test_the_edge_between_side_and_roof_is_one_of_the_box_s_own() -> None:
    scenery = one_face().paint(ROOFS[0], np.s_[4:20], np.s_[80:141], FACE_M + 0.1)
    assert {(82, 22), (138, 22), (82, 17), (138, 17)} <= corners(scenery.pick())


def test_pairs_across_have_their_ends_on_two_faces() -> None:
    scenery = one_face().paint(BOXES[1], np.s_[30:71], np.s_[10:51], 3.0)
    pairs = scenery.pick()
    assert np.count_nonzero(pairs.across) == 4
    ends = pairs.first[pairs.across], pairs.second[pairs.across]
    on = [scenery.ids[pixels[:, 1], pixels[:, 0]] for pixels in ends]
    assert (on[0] != on[1]).all()
    assert set(np.concatenate(on)) == {BOXES[0], BOXES[1]}


def test_eight_edges_at_most_and_another_seed_picks_others() -> None:
    scenery = Scenery()
    for at in (10, 60, 110):
        scenery.paint(BOXES[0], np.s_[20:60], np.s_[at : at + 40])
    picks = [scenery.pick(seed) for seed in range(6)]
    assert {int(np.count_nonzero(~pairs.across)) for pairs in picks} == {8}
    assert len({pairs.first[:8].tobytes() for pairs in picks}) > 1
    np.testing.assert_array_equal(picks[3].first, scenery.pick(3).first)


def test_a_patch_smooths_and_fills_nothing() -> None:
    scenery = one_face()
    pairs = scenery.pick()
    truth = pair_distances(scenery.depth, pairs, CAMERA)
    scenery.depth[22, 82] = 9.0
    assert np.abs(pair_distances(scenery.depth, pairs, CAMERA) - truth).max() > 1.0
    np.testing.assert_allclose(pair_distances(scenery.depth, pairs, CAMERA, 3), truth)
    scenery.depth[23, 82] = np.nan  # of others it is left out
    np.testing.assert_allclose(pair_distances(scenery.depth, pairs, CAMERA, 3), truth)
    scenery.depth[22, 82] = np.nan
    ends = np.stack([pairs.first, pairs.second], axis=1)
    touches = (ends == (82, 22)).all(axis=2).any(axis=1)
    assert touches.sum() == 2
    for patch_px in (1, 9):
        found = pair_distances(scenery.depth, pairs, CAMERA, patch_px)
        np.testing.assert_array_equal(np.isnan(found), touches)


# --- distances from the camera --------------------------------------------------------------------


def test_points_lie_inside_obstacles_and_ground_within_reach() -> None:
    scenery = Scenery().paint(BACKGROUND, np.s_[:], np.s_[:])
    ids = (
        scenery.paint(BOXES[3], np.s_[20:60], np.s_[30:90]).paint(CARPET, np.s_[60:], np.s_[:]).ids
    )
    points = draw_points(paper_map(ids), scenery.depth, CAMERA, np.random.default_rng(0))
    columns, rows = points.pixels.T
    own = ids[rows, columns]
    assert (own == np.where(points.obstacle, BOXES[3], CARPET)).all()
    assert (points.obstacle.sum(), len(own)) == (40, 80)
    for step in (-2, 2):
        assert (ids[np.minimum(rows + step, 111), columns] == own).all()
        assert (ids[rows, np.clip(columns + step, 0, 223)] == own).all()
    x, y = (columns - CAMERA.cx_px) / CAMERA.fx_px, (rows - CAMERA.cy_px) / CAMERA.fy_px
    np.testing.assert_allclose(points.range_m, 2.0 * np.sqrt(1 + x**2 + y**2), rtol=1e-6)
    np.testing.assert_allclose(ranges_at(scenery.depth, points, CAMERA), points.range_m)
    assert np.isnan(ranges_at(np.full_like(scenery.depth, np.nan), points, CAMERA)).all()
    for depth_m in (0.1, 7.0):
        far = np.full_like(scenery.depth, depth_m)
        nothing = draw_points(paper_map(ids), far, CAMERA, np.random.default_rng(0))
        assert nothing.range_m.size == 0


# --- errors ---------------------------------------------------------------------------------------


def test_figures_are_those_worked_out_by_hand() -> None:
    estimated, truth = [1.1, np.nan, 2.3, 2.8, 4.0], [1.0, 9.0, 2.0, 3.0, 4.0]
    summary = summarise_errors(np.array(estimated), np.array(truth))
    assert (summary.total, summary.valid) == (5, 4)
    assert summary.mean_m == pytest.approx(0.15)
    assert summary.median_m == pytest.approx(0.15)
    assert summary.rmse_m == pytest.approx(math.sqrt(0.14 / 4))
    assert summary.max_m == pytest.approx(0.3)
    assert summary.p95_m == pytest.approx(0.285)
    assert summary.bias_m == pytest.approx(0.05)
    assert summary.rmse_m**2 == pytest.approx(summary.mean_m**2 + summary.std_m**2)
    known = [1.1, 2.3, 2.8, 4.0], [1.0, 2.0, 3.0, 4.0]
    assert summary.correlation == pytest.approx(np.corrcoef(*known)[0, 1])


@pytest.mark.parametrize("count", [0, 3])
def test_without_any_estimate_the_figures_are_no_numbers(count: int) -> None:
    summary = summarise_errors(np.full(count, np.nan), np.ones(count))
    assert (summary.total, summary.valid) == (count, 0)
    assert math.isnan(summary.mean_m)
    assert math.isnan(summary.correlation)


def test_estimates_that_never_vary_correlate_with_nothing() -> None:
    assert math.isnan(summarise_errors(np.array([2.0, 2.0]), np.array([1.0, 3.0])).correlation)
