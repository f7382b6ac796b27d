"""Confusion counts and intersection over union."""

import numpy as np
import pytest

from perception.segmentation import evaluation
from tests.paper_lab import CLASSES
from uav_bt.errors import ValueRangeError


def _map(*rows: list[int]) -> np.ndarray:
    return np.array(rows, dtype=np.uint8)


def test_known_value() -> None:
    """Ground: 2 right of 3 predicted and 3 exact, so 2 / 4; box 1: 1 of 2 and 1, so 1 / 2."""
    exact = _map([1, 1, 1], [4, 0, 0])
    predicted = _map([1, 1, 4], [4, 1, 0])
    score = evaluation.score_segmentation([(predicted, exact)], CLASSES)
    assert score.iou[1] == pytest.approx(2 / 4)
    assert score.iou[4] == pytest.approx(1 / 2)
    assert score.iou[0] == pytest.approx(1 / 2)
    assert score.miou == pytest.approx(0.5)
    assert score.accuracy == pytest.approx(4 / 6)
    assert score.counts[1, 4] == 1


def test_a_mistake_within_a_role_does_not_count_for_the_roles() -> None:
    exact, predicted = _map([4, 5, 0]), _map([16, 12, 0])
    score = evaluation.score_segmentation([(predicted, exact)], CLASSES)
    assert score.role_miou == 1.0
    assert score.miou == pytest.approx(1 / 3)
    assert score.role_counts[3, 3] == 2


def test_a_class_that_never_appears_does_not_enter_the_mean() -> None:
    score = evaluation.score_segmentation([(_map([0, 7]), _map([0, 0]))], CLASSES)
    assert np.isnan(score.iou[7])
    assert score.miou == pytest.approx(0.5)


def test_pictures_add_up() -> None:
    pairs = [(_map([0, 1]), _map([0, 1])), (_map([0, 0]), _map([1, 1]))]
    score = evaluation.score_segmentation(pairs, CLASSES)
    assert score.images == 2
    assert score.iou[1] == pytest.approx(1 / 3)


def test_an_exact_map_of_another_size_is_brought_to_the_predicted_one() -> None:
    exact = np.repeat(np.repeat(_map([0, 1], [4, 4]), 10, axis=0), 10, axis=1)
    score = evaluation.score_segmentation([(_map([0, 1], [4, 4]), exact)], CLASSES)
    assert score.miou == 1.0


def test_no_images_are_refused() -> None:
    with pytest.raises(ValueRangeError, match="no images"):
        evaluation.score_segmentation([], CLASSES)
