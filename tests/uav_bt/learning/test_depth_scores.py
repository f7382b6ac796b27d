"""Scores of depth maps: what each of them does and does not depend on."""

import numpy as np
import pytest

from tests.paper_lab import CLASSES
from uav_bt.errors import ValueRangeError
from uav_bt.lab.classes import OBSTACLE
from uav_bt.learning.depth_scores import DepthSample, score_depth


def _sample(factor: float = 1.0, obstacle: float = 1.0) -> DepthSample:
    truth = np.full((20, 30), 2.0, np.float32)
    ids = np.ones((20, 30), np.uint8)
    ids[:5] = 4
    ids[5:6] = 0
    predicted = factor * truth
    predicted[:5] *= obstacle
    return predicted, truth, CLASSES.roles(ids), truth.copy()


def test_the_unit_of_relative_depth_does_not_matter() -> None:
    score = score_depth([_sample(factor=7.0)])
    assert score.abs_rel == pytest.approx(0.0, abs=1e-6)
    assert score.obstacle_error_m == pytest.approx(0.0, abs=1e-6)
    assert score.metric_error_m == pytest.approx(12.0)
    assert score.delta_1 == 1.0


def test_obstacles_are_measured_with_the_grounds_scale() -> None:
    score = score_depth([_sample(factor=3.0, obstacle=1.1)])
    assert score.obstacle_error_m == pytest.approx(0.2, rel=1e-4)
    assert score.obstacle_abs_rel == pytest.approx(0.1, rel=1e-4)
    assert score.ground_error_m == pytest.approx(0.0, abs=1e-6)


def test_a_view_without_ground_has_no_metric_error() -> None:
    predicted, truth, roles, ground = _sample()
    score = score_depth([(predicted, truth, np.full_like(roles, OBSTACLE), ground), _sample()])
    assert score.images == 2
    assert score.obstacle_error_m == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize(
    ("samples", "words"), [([_sample(factor=-1.0)], "positive and finite"), ([], "no images")]
)
def test_what_has_no_score_is_refused(samples: list[DepthSample], words: str) -> None:
    with pytest.raises(ValueRangeError, match=words):
        score_depth(samples)
