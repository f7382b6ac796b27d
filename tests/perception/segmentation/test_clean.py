"""Votes to class maps: dots, components, holes."""

from dataclasses import replace

import numpy as np
import pytest

from perception.segmentation import clean
from perception.segmentation.evaluation import score_segmentation
from perception.segmentation.teacher import Teacher, TeacherConfig, fit_teacher
from perception.segmentation.training.picks import draw_picks, gather_patches
from tests.paper_lab import BACKGROUND, CARPET, CLASSES
from tests.perception.segmentation.patterned import samples
from uav_bt.errors import ShapeError, ValueRangeError


def test_dots_dilate_to_a_map_without_gaps() -> None:
    ids = np.full((52, 73), 5, dtype=np.uint8)
    assert (clean.dilated_grid(ids) == 5).all()


def test_an_object_gains_the_margin_over_the_background() -> None:
    ids = np.zeros((60, 60), dtype=np.uint8)
    ids[20:40, 20:40] = 6
    painted = clean.dilated_grid(ids, step_px=5, dilation_px=9)
    assert (painted == 6).sum() > (ids == 6).sum()
    assert painted[0, 0] == 0


def test_a_grid_with_gaps_is_refused() -> None:
    with pytest.raises(ValueRangeError, match="every 5 pixels"):
        clean.dilated_grid(np.zeros((9, 9), np.uint8), step_px=5, dilation_px=4)
    with pytest.raises(ShapeError, match="HxW"):
        clean.dilated_grid(np.zeros((9, 9, 1), np.uint8))


def test_only_the_largest_piece_of_an_object_stays() -> None:
    ids = np.zeros((40, 40), dtype=np.uint8)
    ids[5:20, 5:20] = 4
    ids[30:33, 30:33] = 4
    ids[33:36, 33:36] = 4  # touches the one before at a corner: the same piece
    kept = clean.keep_largest_components(ids, (BACKGROUND, CARPET))
    assert (kept[5:20, 5:20] == 4).all()
    assert (kept == 4).sum() == 15 * 15


def test_background_and_ground_keep_all_their_pieces() -> None:
    ids = np.full((40, 40), 1, dtype=np.uint8)
    ids[:5, :5] = 0
    ids[20:30, 20:30] = 0
    np.testing.assert_array_equal(clean.keep_largest_components(ids, (BACKGROUND, CARPET)), ids)


def test_a_dropped_piece_takes_the_nearest_class() -> None:
    ids = np.zeros((20, 60), dtype=np.uint8)
    ids[:, 30:] = 1
    ids[5:8, 50:53] = 7
    ids[:, :12] = 7
    assert clean.keep_largest_components(ids, (BACKGROUND, CARPET))[6, 51] == 1


def test_small_pieces_go_and_large_ones_stay_whatever_their_number() -> None:
    ids = np.zeros((40, 40), dtype=np.uint8)
    ids[5:15, 5:15] = 12
    ids[25:35, 25:35] = 12
    ids[2, 30:34] = 12
    kept = clean.drop_small_components(ids, area_px=20)
    assert (kept == 12).sum() == 200


def test_a_map_of_one_class_stays_as_it_is() -> None:
    ids = np.full((10, 10), 3, dtype=np.uint8)
    np.testing.assert_array_equal(clean.drop_small_components(ids, area_px=1000), ids)


def test_a_hole_in_a_boxs_side_is_filled() -> None:
    ids = np.full((60, 60), 4, dtype=np.uint8)
    ids[20:30, 20:30] = 0
    ids[0:6, 0:6] = 0  # at the picture's edge: as much a hole
    filled = clean.filled_holes(ids, inside=(4,), area_px=100)
    assert (filled == 4).all()


def test_what_is_too_large_or_between_two_classes_or_exempt_is_no_hole() -> None:
    ids = np.full((60, 60), 4, dtype=np.uint8)
    ids[5:20, 5:20] = 0
    ids[:, 40:] = 5
    ids[30:36, 37:43] = 0
    ids[50:55, 10:15] = 2
    filled = clean.filled_holes(ids, inside=(4, 5), but=(2,), area_px=100)
    np.testing.assert_array_equal(filled, ids)


def test_a_thing_before_the_ground_is_no_hole() -> None:
    ids = np.ones((60, 60), dtype=np.uint8)
    ids[20:25, 20:25] = 4
    np.testing.assert_array_equal(clean.filled_holes(ids, inside=(4,), area_px=100), ids)


CONFIG = clean.RefineConfig(neighbourhood_px=13, smallest_px=8, hole_px=20)


@pytest.fixture(scope="module")
def teacher() -> Teacher:
    drawn = draw_picks(
        ((name, ids) for name, _, ids in samples(12, seed=1)),
        np.random.default_rng(0),
        patch_px=12,
        total=600,
    )
    pictures = ((name, rgb) for name, rgb, _ in samples(12, seed=1))
    return fit_teacher(
        gather_patches(drawn, pictures, 12, CLASSES),
        TeacherConfig(width_px=160, height_px=90, patch_px=12),
    )


def test_sharpening_brings_the_map_closer_to_the_exact_one(teacher: Teacher) -> None:
    plain, sharp = (
        score_segmentation(
            ((teacher.refined_ids(rgb, config), ids) for _, rgb, ids in samples(6, seed=5)), CLASSES
        )
        for config in (replace(CONFIG, rounds=0), CONFIG)
    )
    assert sharp.miou > plain.miou + 0.02
    assert sharp.role_miou > plain.role_miou + 0.02


def test_no_rounds_leave_the_windows_vote(teacher: Teacher) -> None:
    (_, rgb, _) = next(samples(1, seed=5))
    ids = teacher.refined_ids(rgb, replace(CONFIG, rounds=0))
    np.testing.assert_array_equal(ids, teacher.window_ids(rgb))


def test_sharpening_invents_no_class(teacher: Teacher) -> None:
    (_, rgb, _) = next(samples(1, seed=6))
    assert teacher.palette is not None
    ids = np.zeros((90, 160), dtype=np.uint8)
    ids[:, 80:] = 1
    sharp = clean.sharpened(ids, rgb, teacher.palette, CONFIG)
    assert set(np.unique(sharp)) <= {0, 1}


def test_a_teacher_without_a_palette_says_so(teacher: Teacher) -> None:
    (_, rgb, _) = next(samples(1, seed=6))
    with pytest.raises(ValueRangeError, match="no palette"):
        replace(teacher, palette=None).refined_ids(rgb, CONFIG)


def test_map_and_picture_of_different_size_are_refused(teacher: Teacher) -> None:
    assert teacher.palette is not None
    with pytest.raises(ShapeError, match="90x160, got 90x161"):
        clean.sharpened(
            np.zeros((90, 161), np.uint8),
            np.zeros((90, 160, 3), np.uint8),
            teacher.palette,
            CONFIG,
        )
    with pytest.raises(ValueRangeError, match="must not be negative"):
        clean.RefineConfig(rounds=-1)
