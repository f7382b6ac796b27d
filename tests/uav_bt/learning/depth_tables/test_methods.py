"""Baseline methods of metric depth: constant scales, and the lowest pixel."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
import pytest
from uav_bt.learning.depth_tables.methods import CollectedScale, lowest_pixel_depth

from perception.camera.ground_plane import CameraView, ground_depth
from perception.depth.scale import GroundSample
from tests.paper_lab import BOXES, CARPET, HELIPAD_BOX, HELIPAD_H, ROOFS, paper_map
from uav_bt.types import CameraModel

VIEW = CameraView(
    camera=CameraModel(
        width_px=224, height_px=112, fx_px=160.0, fy_px=150.0, cx_px=111.5, cy_px=55.5
    ),
    pitch_rad=math.radians(-28.0),
    height_m=1.5,
)
GROUND = ground_depth(VIEW)


def bare_ground() -> np.ndarray:
    ids = np.zeros((112, 224), dtype=np.uint8)
    ids[40:] = CARPET
    return ids


def test_side_and_roof_stand_where_the_lowest_pixel_is() -> None:
    ids = bare_ground()
    ids[50:80, 40:80] = BOXES[0]
    ids[40:50, 40:80] = ROOFS[0]
    depth = lowest_pixel_depth(paper_map(ids), VIEW)
    np.testing.assert_allclose(depth[40:80, 40:80], GROUND[79, 40])
    np.testing.assert_array_equal(depth[ids == CARPET], GROUND[ids == CARPET])


def test_the_background_is_unknown() -> None:
    ids = bare_ground()
    assert np.isnan(lowest_pixel_depth(paper_map(ids), VIEW)[ids == 0]).all()


def test_two_boxes_with_like_roofs_are_two_things() -> None:
    ids = bare_ground()
    ids[50:80, 40:80], ids[45:50, 40:80] = BOXES[0], ROOFS[0]
    ids[50:100, 140:180], ids[45:50, 140:180] = BOXES[5], ROOFS[0]
    depth = lowest_pixel_depth(paper_map(ids), VIEW)
    np.testing.assert_allclose(depth[45:80, 40:80], GROUND[79, 40])
    np.testing.assert_allclose(depth[45:100, 140:180], GROUND[99, 140])


def test_the_mark_stands_on_the_ground_too() -> None:
    ids = bare_ground()
    ids[60:90, 100:150] = HELIPAD_BOX
    ids[62:70, 110:140] = HELIPAD_H
    np.testing.assert_allclose(
        lowest_pixel_depth(paper_map(ids), VIEW)[60:90, 100:150], GROUND[89, 120]
    )


def test_a_roof_without_its_side_is_unknown() -> None:
    ids = bare_ground()
    ids[90:, 40:80] = ROOFS[2]
    assert np.isnan(lowest_pixel_depth(paper_map(ids), VIEW)[90:, 40:80]).all()


# --- constant scales ------------------------------------------------------------------------------


def sample(known_m: float, predicted: float) -> GroundSample:
    return GroundSample(
        known_m=np.full(3, known_m, np.float32), predicted=np.full(3, predicted, np.float32)
    )


def test_least_squares_agrees_with_the_textbook_on_noisy_frames() -> None:
    generator = np.random.default_rng(1)
    given = generator.uniform(0.5, 3.0, 40)
    known = 2.0 * given - 0.1 + generator.normal(0.0, 0.05, 40)
    estimator = CollectedScale("least_squares")
    scale = None
    for frame in range(40):
        scale = estimator(sample(known[frame], given[frame]), 0.1 * frame)

    expected = np.linalg.lstsq(np.stack([given, np.ones(40)], axis=1), known, rcond=None)[0]
    assert scale is not None
    assert (scale.factor, scale.shift_m) == pytest.approx(tuple(expected), rel=1e-5)


@pytest.mark.parametrize("method", ["constant", "least_squares"])
def test_frames_that_are_alike_have_no_shift(method: Literal["constant", "least_squares"]) -> None:
    estimator = CollectedScale(method)
    assert estimator(None, 0.0) is None
    for known_m in (1.0, 1.1, 30.0):
        scale = estimator(sample(known_m, 0.5), 0.0)
    assert scale is not None
    assert (scale.factor, scale.shift_m) == (pytest.approx(2.2), 0.0)
