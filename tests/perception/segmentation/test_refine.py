"""Sharp borders from windows and palettes."""

from dataclasses import replace

import numpy as np
import pytest

from perception.segmentation import palette, refine
from perception.segmentation.evaluation import score_segmentation
from perception.segmentation.teacher import Teacher, TeacherConfig, fit_teacher
from perception.segmentation.training.picks import draw_picks, gather_patches
from tests.perception.segmentation.patterned import samples
from uav_bt.errors import ShapeError, ValueRangeError

CONFIG = refine.RefineConfig(neighbourhood_px=13, smallest_px=8, hole_px=20)


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
        gather_patches(drawn, pictures, 12),
        TeacherConfig(width_px=160, height_px=90, patch_px=12),
    )


def test_sharpening_brings_the_map_closer_to_the_exact_one(teacher: Teacher) -> None:
    plain, sharp = (
        score_segmentation(
            (refine.refined_ids(teacher, rgb, config), ids) for _, rgb, ids in samples(6, seed=5)
        )
        for config in (replace(CONFIG, rounds=0), CONFIG)
    )
    assert sharp.miou > plain.miou + 0.02
    assert sharp.group_miou > plain.group_miou + 0.02


def test_no_rounds_leave_the_windows_vote(teacher: Teacher) -> None:
    (_, rgb, _) = next(samples(1, seed=5))
    ids = refine.refined_ids(teacher, rgb, replace(CONFIG, rounds=0))
    np.testing.assert_array_equal(ids, teacher.window_ids(rgb))


def test_sharpening_invents_no_class(teacher: Teacher) -> None:
    (_, rgb, _) = next(samples(1, seed=6))
    assert teacher.palette is not None
    ids = np.zeros((90, 160), dtype=np.uint8)
    ids[:, 80:] = 1
    sharp = refine.sharpened(ids, rgb, teacher.palette, CONFIG)
    assert set(np.unique(sharp)) <= {0, 1}


def test_a_teacher_without_a_palette_says_so(teacher: Teacher) -> None:
    (_, rgb, _) = next(samples(1, seed=6))
    with pytest.raises(ValueRangeError, match="no palette"):
        refine.refined_ids(replace(teacher, palette=None), rgb, CONFIG)


def test_map_and_picture_of_different_size_are_refused(teacher: Teacher) -> None:
    assert teacher.palette is not None
    with pytest.raises(ShapeError, match="90x160, got 90x161"):
        refine.sharpened(
            np.zeros((90, 161), np.uint8),
            np.zeros((90, 160, 3), np.uint8),
            teacher.palette,
            CONFIG,
        )
    with pytest.raises(ValueRangeError, match="must not be negative"):
        refine.RefineConfig(rounds=-1)


def test_a_palette_is_a_distribution_over_colours() -> None:
    counts = np.zeros((17, palette.COLOUR_COUNT), dtype=np.int64)
    counts[3, 1234] = 50
    likelihood = np.exp(palette.palette_of_counts(counts).astype(np.float64))
    np.testing.assert_allclose(likelihood.sum(axis=1), 1.0, rtol=1e-4)
    assert likelihood[3].argmax() == 1234
    np.testing.assert_allclose(likelihood[0], 1.0 / palette.COLOUR_COUNT, rtol=1e-4)


def test_colour_codes_keep_the_five_highest_bits_of_each_channel() -> None:
    rgb = np.array([[[255, 0, 0], [7, 8, 0], [0, 0, 255]]], dtype=np.uint8)
    assert palette.colour_codes(rgb).tolist() == [[31 << 10, 1 << 5, 31]]
    assert palette.count_colours(rgb).sum() == 3
    with pytest.raises(ShapeError, match="HxWx3"):
        palette.colour_codes(np.zeros((2, 2), np.uint8))
    with pytest.raises(ValueRangeError, match="uint8"):
        palette.colour_codes(np.zeros((2, 2, 3)))  # type: ignore[arg-type]
    with pytest.raises(ShapeError, match="17x32768"):
        palette.palette_of_counts(np.zeros((4, 8), np.int64))
