"""Class maps without speckles, and their scores."""

import numpy as np
import pytest

from perception.segmentation import clean, evaluation
from perception.segmentation.evaluation import score_segmentation
from perception.segmentation.teacher import TeacherConfig
from tests.paper_lab import BACKGROUND, CARPET, CLASSES
from tests.perception.segmentation.patterned import samples, teacher
from uav_bt.errors import ValueRangeError
from uav_bt.types.arrays import Image

SCATTERED = (BACKGROUND, CARPET)


def blank(height: int, width: int, class_id: int = 0) -> Image:
    return np.full((height, width), class_id, dtype=np.uint8)


def test_dots_dilate_to_a_map_without_gaps_and_objects_gain_the_margin() -> None:
    assert (clean.dilated_grid(blank(52, 73, 5)) == 5).all()
    ids = blank(60, 60)
    ids[20:40, 20:40] = 6
    painted = clean.dilated_grid(ids)
    assert (painted == 6).sum() > (ids == 6).sum()
    assert painted[0, 0] == 0


def test_only_the_largest_piece_of_an_object_stays() -> None:
    """The ground and what is around keep all theirs."""
    ids = blank(40, 60)
    ids[5:20, 5:20] = 4
    ids[30:33, 30:33] = 4
    ids[33:36, 33:36] = 4  # touches the one before at a corner: the same piece
    ids[:, 42:] = 1
    ids[20:23, 50:53] = 4
    ids[:3, 57:] = 0
    kept = clean.keep_largest_components(ids, SCATTERED)
    assert (kept[5:20, 5:20] == 4).all()
    assert (kept == 4).sum() == 15 * 15
    assert (kept[31, 31], kept[21, 51], kept[1, 58]) == (0, 1, 0)
    # Small pieces go and large ones stay, whatever their number.
    ids = blank(40, 40)
    ids[5:15, 5:15] = ids[25:35, 25:35] = ids[2, 30:34] = 12
    assert (clean.drop_small_components(ids, area_px=20) == 12).sum() == 200
    np.testing.assert_array_equal(clean.drop_small_components(blank(9, 9), area_px=1000), 0)


def test_a_small_hole_within_one_class_is_filled_and_no_other() -> None:
    box, ground = blank(60, 60, 4), blank(60, 60, 1)
    box[20:30, 20:30] = box[0:6, 0:6] = 0  # at the picture's edge: as much a hole
    assert (clean.filled_holes(box, inside=(4,), area_px=100) == 4).all()
    ids = blank(60, 60, 4)  # too large, between two classes, and exempt
    ids[5:20, 5:20] = 0
    ids[:, 40:] = 5
    ids[30:36, 37:43] = 0
    ids[50:55, 10:15] = 2
    filled = clean.filled_holes(ids, inside=(4, 5), but=(2,), area_px=100)
    np.testing.assert_array_equal(filled, ids)
    ground[20:25, 20:25] = 4  # before the ground stands an object
    np.testing.assert_array_equal(clean.filled_holes(ground, inside=(4,), area_px=100), ground)


def test_sharpening_brings_the_map_closer_to_the_exact_one_and_invents_no_class() -> None:
    size = {"width": 480, "height": 270}
    trained = teacher(TeacherConfig(width_px=480, height_px=270, patch_px=40))
    pictures = [(rgb, ids) for _, rgb, ids in samples(4, seed=5, **size)]
    plain, sharp = (
        score_segmentation(((ids_of(rgb), ids) for rgb, ids in pictures), CLASSES)
        for ids_of in (trained.window_ids, trained.refined_ids)
    )
    assert sharp.miou > plain.miou + 0.02
    assert sharp.role_miou > plain.role_miou + 0.02
    ids = blank(270, 480)
    ids[:, 240:] = 1
    assert set(np.unique(clean.sharpened(ids, pictures[0][0], trained.palette))) <= {0, 1}


# --- confusion counts and intersection over union -------------------------------------------------

PAIRS = [([0, 1], [0, 1]), ([1, 1], [0, 0])]  # predicted and exact


def test_known_values() -> None:
    for predicted, exact, iou, role_miou in (
        # Ground: 2 right of 3 predicted and 3 exact, so 2 / 4; box 1: 1 of 2 and 1, so 1 / 2.
        ([[1, 1, 4], [4, 1, 0]], [[1, 1, 1], [4, 0, 0]], {1: 2 / 4, 4: 1 / 2, 0: 1 / 2}, 1 / 2),
        # A mistake within a role does not count for the roles.
        ([[16, 12, 0]], [[4, 5, 0]], {0: 1.0, 4: 0.0, 5: 0.0}, 1.0),
        # A class that never appears is none of the mean.
        ([[0, 7]], [[0, 0]], {0: 0.5}, 0.5),
        # An exact map of another size is brought to the predicted one.
        ([[0, 1], [4, 4]], np.kron([[0, 1], [4, 4]], np.ones((10, 10))), {0: 1, 1: 1, 4: 1}, 1.0),
    ):
        pair = tuple(np.array(rows, dtype=np.uint8) for rows in (predicted, exact))
        score = evaluation.score_segmentation([pair], CLASSES)
        assert {each: score.iou[each] for each in iou} == pytest.approx(iou)
        assert score.miou == pytest.approx(sum(iou.values()) / len(iou))
        assert score.role_miou == pytest.approx(role_miou)


def test_pictures_add_up_and_none_are_refused() -> None:
    pairs = [(np.array([each], np.uint8) for each in pair) for pair in PAIRS]
    score = evaluation.score_segmentation(pairs, CLASSES)
    assert score.images == 2
    assert score.iou[1] == pytest.approx(1 / 3)
    assert np.isnan(score.iou[7])
    assert score.accuracy == pytest.approx(2 / 4)
    assert (score.counts[0, 1], score.role_counts.sum()) == (2, 4)
    with pytest.raises(ValueRangeError, match="no images"):
        evaluation.score_segmentation([], CLASSES)
