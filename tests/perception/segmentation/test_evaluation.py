"""Confusion counts and intersection over union."""

import numpy as np
import pytest

from perception.segmentation import evaluation
from tests.paper_lab import CLASSES
from uav_bt.errors import ValueRangeError

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
