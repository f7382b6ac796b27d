"""Pairs of points: which corners are picked, and what distances depth maps give them."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from perception.depth.evaluation.point_pairs import (
    PairConfig,
    PointPairs,
    pair_distances,
    patch_depths,
    pick_pairs,
)
from tests.paper_lab import BACKGROUND, BOXES, CARPET, HELIPAD_BOX, ROOFS, paper_map
from uav_bt.errors import ShapeError, ValueRangeError
from uav_bt.types import CameraModel

CAMERA = CameraModel(width_px=224, height_px=112, fx_px=160.0, fy_px=150.0, cx_px=111.5, cy_px=55.5)
FACE_M = 2.0


class Scenery:
    """A class map and its depth, painted by rectangles that face the camera."""

    def __init__(self) -> None:
        self.ids: NDArray[np.uint8] = np.full((112, 224), BACKGROUND, dtype=np.uint8)
        self.depth: NDArray[np.float32] = np.full((112, 224), 6.0, dtype=np.float32)

    def paint(self, thing: int, rows: slice, columns: slice, depth_m: float) -> "Scenery":
        self.ids[rows, columns] = thing
        self.depth[rows, columns] = depth_m
        return self

    def pick(self, seed: int = 0, config: PairConfig | None = None) -> PointPairs:
        generator = np.random.default_rng(seed)
        return pick_pairs(paper_map(self.ids), self.depth, CAMERA, generator, config)


def one_face() -> Scenery:
    return Scenery().paint(BOXES[0], np.s_[20:81], np.s_[80:141], FACE_M)


def corners(pairs: PointPairs) -> set[tuple[int, int]]:
    return {(int(x), int(y)) for x, y in np.concatenate([pairs.first, pairs.second])}


def test_the_edges_of_a_face_span_its_corners_two_pixels_inside() -> None:
    pairs = one_face().pick()
    assert len(pairs) == 4
    assert not pairs.across.any()
    assert corners(pairs) == {(82, 22), (138, 22), (138, 78), (82, 78)}


def test_the_true_distance_is_the_edge_in_space() -> None:
    scenery = one_face()
    lengths = pair_distances(scenery.depth, scenery.pick(), CAMERA)
    across, upright = 56 / CAMERA.fx_px * FACE_M, 56 / CAMERA.fy_px * FACE_M
    np.testing.assert_allclose(sorted(lengths), [across, across, upright, upright], rtol=1e-6)


def test_a_face_that_the_image_cuts_off_keeps_only_the_edges_within() -> None:
    pairs = Scenery().paint(BOXES[0], np.s_[:81], np.s_[80:141], FACE_M).pick()
    assert corners(pairs) == {(82, 78), (138, 78)}


def test_a_corner_that_another_thing_makes_is_not_picked() -> None:
    hidden = one_face().paint(HELIPAD_BOX, np.s_[60:112], np.s_[120:200], 1.0).pick()
    assert corners(hidden) == {(82, 22), (138, 22), (82, 78)}


@pytest.mark.parametrize("thing", [CARPET, BACKGROUND])
def test_the_nearer_ground_hides_no_base(thing: int) -> None:
    scenery = one_face().paint(thing, np.s_[81:], np.s_[:], 1.5)
    assert (138, 78) in corners(scenery.pick())


def test_the_edge_between_side_and_roof_is_one_of_the_box_s_own() -> None:
    scenery = one_face().paint(ROOFS[0], np.s_[4:20], np.s_[80:141], FACE_M + 0.1)
    assert {(82, 22), (138, 22), (82, 17), (138, 17)} <= corners(scenery.pick())


@pytest.mark.parametrize("thing", [CARPET, BACKGROUND, HELIPAD_BOX])
def test_only_obstacles_have_edges(thing: int) -> None:
    assert len(Scenery().paint(thing, np.s_[20:81], np.s_[80:141], FACE_M).pick()) == 0


def test_a_speck_has_no_edges() -> None:
    assert len(Scenery().paint(BOXES[2], np.s_[20:27], np.s_[80:87], FACE_M).pick()) == 0


def test_a_strip_that_shrinks_to_a_line_has_no_edges() -> None:
    assert len(Scenery().paint(BOXES[2], np.s_[20:25], np.s_[80:141], FACE_M).pick()) == 0


def test_pairs_across_have_their_ends_on_two_faces() -> None:
    scenery = one_face().paint(BOXES[1], np.s_[30:71], np.s_[10:51], 3.0)
    pairs = scenery.pick(config=PairConfig(max_across=3))
    assert np.count_nonzero(pairs.across) == 3
    first, second = pairs.first[pairs.across], pairs.second[pairs.across]
    on = [scenery.ids[ends[:, 1], ends[:, 0]] for ends in (first, second)]
    assert (on[0] != on[1]).all()
    assert set(np.concatenate(on)) == {BOXES[0], BOXES[1]}


def test_no_more_edges_than_wanted_and_another_seed_picks_others() -> None:
    config = PairConfig(max_edges=1)
    picks = [one_face().pick(seed, config) for seed in range(12)]
    assert {len(pairs) for pairs in picks} == {1}
    assert len({tuple(pairs.first[0]) for pairs in picks}) > 1
    np.testing.assert_array_equal(picks[3].first, one_face().pick(3, config).first)


def test_picking_refuses_maps_of_another_size() -> None:
    scenery = one_face()
    half = CAMERA.resized(112, 56)
    with pytest.raises(ShapeError, match="class map must be 56x112, as the camera, got 112x224"):
        pick_pairs(paper_map(scenery.ids), scenery.depth, half, np.random.default_rng(0))
    with pytest.raises(ShapeError, match="depth map"):
        pair_distances(scenery.depth, scenery.pick(), half)


def test_unusable_settings_are_refused() -> None:
    with pytest.raises(ValueRangeError, match="inset_px"):
        replace(PairConfig(), inset_px=-1)


def test_twice_the_depth_is_twice_the_distance() -> None:
    scenery = one_face()
    pairs = scenery.pick()
    np.testing.assert_allclose(
        pair_distances(2.0 * scenery.depth, pairs, CAMERA),
        2.0 * pair_distances(scenery.depth, pairs, CAMERA),
    )


def test_a_patch_takes_out_one_wrong_pixel() -> None:
    scenery = one_face()
    pairs = scenery.pick()
    truth = pair_distances(scenery.depth, pairs, CAMERA)
    scenery.depth[22, 82] = 9.0
    assert np.abs(pair_distances(scenery.depth, pairs, CAMERA) - truth).max() > 1.0
    patched = pair_distances(scenery.depth, pairs, CAMERA, patch_px=3)
    np.testing.assert_allclose(patched, truth)


def test_the_median_of_a_patch_leaves_out_what_is_unknown_or_outside() -> None:
    depth = np.arange(20, dtype=np.float32).reshape(4, 5)
    depth[0, 1] = np.nan
    pixels = np.array([[0, 0], [2, 2]])
    np.testing.assert_allclose(patch_depths(depth, pixels, 3), [5.0, 12.0])
    np.testing.assert_allclose(patch_depths(depth, pixels, 1), [0.0, 12.0])


def test_a_corner_of_unknown_depth_has_no_distance_whatever_lies_around() -> None:
    scenery = one_face()
    pairs = scenery.pick()
    scenery.depth[22, 82] = np.nan
    ends = np.stack([pairs.first, pairs.second], axis=1)
    touches = (ends == (82, 22)).all(axis=2).any(axis=1)
    assert touches.sum() == 2
    for patch_px in (1, 9):
        distances = pair_distances(scenery.depth, pairs, CAMERA, patch_px=patch_px)
        np.testing.assert_array_equal(np.isnan(distances), touches)


@pytest.mark.parametrize("side", [0, 2, -3])
def test_a_patch_without_a_middle_is_refused(side: int) -> None:
    with pytest.raises(ValueRangeError, match="odd, positive"):
        patch_depths(np.ones((4, 4), dtype=np.float32), np.zeros((1, 2), dtype=np.intp), side)
