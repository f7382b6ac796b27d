"""The lowest-pixel baseline: right for what stands in front, wrong as it is meant to be."""

import math

import numpy as np
import pytest

from perception.camera.ground_plane import CameraView, ground_depth
from perception.depth.evaluation.lowest_pixel import lowest_pixel_depth
from uav_bt.classes import BOXES, CARPET, HELIPAD_BOX, HELIPAD_H, ROOFS
from uav_bt.errors import ShapeError
from uav_bt.types import CameraModel

VIEW = CameraView(
    camera=CameraModel(
        width_px=224, height_px=112, fx_px=160.0, fy_px=150.0, cx_px=111.5, cy_px=55.5
    ),
    pitch_rad=math.radians(-28.0),
    height_m=1.5,
)
GROUND = ground_depth(VIEW)


def carpet() -> np.ndarray:
    ids = np.zeros((112, 224), dtype=np.uint8)
    ids[40:] = CARPET
    return ids


def test_side_and_roof_stand_where_the_lowest_pixel_is() -> None:
    ids = carpet()
    ids[50:80, 40:80] = BOXES[0]
    ids[40:50, 40:80] = ROOFS[0]
    depth = lowest_pixel_depth(ids, VIEW)
    np.testing.assert_allclose(depth[40:80, 40:80], GROUND[79, 40])
    np.testing.assert_array_equal(depth[ids == CARPET], GROUND[ids == CARPET])


def test_the_background_is_unknown() -> None:
    ids = carpet()
    assert np.isnan(lowest_pixel_depth(ids, VIEW)[ids == 0]).all()


def test_two_boxes_with_like_roofs_are_two_things() -> None:
    ids = carpet()
    ids[50:80, 40:80], ids[45:50, 40:80] = BOXES[0], ROOFS[0]
    ids[50:100, 140:180], ids[45:50, 140:180] = BOXES[5], ROOFS[0]
    depth = lowest_pixel_depth(ids, VIEW)
    np.testing.assert_allclose(depth[45:80, 40:80], GROUND[79, 40])
    np.testing.assert_allclose(depth[45:100, 140:180], GROUND[99, 140])


def test_the_helipad_stands_on_the_carpet_too() -> None:
    ids = carpet()
    ids[60:90, 100:150] = HELIPAD_BOX
    ids[62:70, 110:140] = HELIPAD_H
    np.testing.assert_allclose(lowest_pixel_depth(ids, VIEW)[60:90, 100:150], GROUND[89, 120])


def test_a_roof_without_its_side_is_unknown() -> None:
    ids = carpet()
    ids[90:, 40:80] = ROOFS[2]
    assert np.isnan(lowest_pixel_depth(ids, VIEW)[90:, 40:80]).all()


def test_a_map_of_another_size_is_refused() -> None:
    with pytest.raises(ShapeError, match="class map must be 112x224, as its camera, got 56x112"):
        lowest_pixel_depth(np.zeros((56, 112), dtype=np.uint8), VIEW)
