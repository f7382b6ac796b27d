"""Points of known distance: where they are drawn, and what ranges depth maps give them."""

import numpy as np
import pytest

from perception.depth.evaluation.measured_points import PointConfig, draw_points, ranges_at
from uav_bt.classes import BACKGROUND, BOXES, CARPET
from uav_bt.errors import ShapeError, ValueRangeError
from uav_bt.types import CameraModel

CAMERA = CameraModel(width_px=224, height_px=112, fx_px=160.0, fy_px=150.0, cx_px=111.5, cy_px=55.5)
IDS = np.full((112, 224), BACKGROUND, dtype=np.uint8)
IDS[20:60, 30:90] = BOXES[3]
IDS[60:] = CARPET
DEPTH_M = np.full((112, 224), 2.0, dtype=np.float32)


def test_points_lie_inside_obstacles_and_carpet() -> None:
    points = draw_points(IDS, DEPTH_M, CAMERA, np.random.default_rng(0))
    columns, rows = points.pixels.T
    assert len(points) == 80
    assert points.obstacle.sum() == 40
    own = IDS[rows, columns]
    assert (own[points.obstacle] == BOXES[3]).all()
    assert (own[~points.obstacle] == CARPET).all()
    for step in (-2, 2):
        assert (IDS[np.minimum(rows + step, 111), columns] == own).all()
        assert (IDS[rows, np.clip(columns + step, 0, 223)] == own).all()


def test_the_range_is_along_the_ray() -> None:
    points = draw_points(IDS, DEPTH_M, CAMERA, np.random.default_rng(0))
    x = (points.pixels[:, 0] - CAMERA.cx_px) / CAMERA.fx_px
    y = (points.pixels[:, 1] - CAMERA.cy_px) / CAMERA.fy_px
    np.testing.assert_allclose(points.range_m, 2.0 * np.sqrt(1 + x**2 + y**2), rtol=1e-6)
    np.testing.assert_allclose(ranges_at(DEPTH_M, points, CAMERA), points.range_m)
    assert np.isnan(ranges_at(np.full_like(DEPTH_M, np.nan), points, CAMERA)).all()


@pytest.mark.parametrize("depth_m", [0.1, 7.0])
def test_nothing_is_drawn_out_of_reach(depth_m: float) -> None:
    far = np.full_like(DEPTH_M, depth_m)
    assert len(draw_points(IDS, far, CAMERA, np.random.default_rng(0))) == 0


def test_maps_of_another_size_are_refused() -> None:
    with pytest.raises(ShapeError, match="depth map must be 112x224"):
        draw_points(IDS, DEPTH_M[:50], CAMERA, np.random.default_rng(0))


def test_unusable_settings_are_refused() -> None:
    with pytest.raises(ValueRangeError, match="nearest_m"):
        PointConfig(nearest_m=5.0, furthest_m=1.0)
