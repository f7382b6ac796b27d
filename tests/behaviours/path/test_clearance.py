"""Distances, clearance and flyable cells of drawn maps, computed by hand."""

import math
from dataclasses import replace

import numpy as np
import pytest

from behaviours.path.clearance import ClearanceMap, Distances
from behaviours.path.margins import Margins
from behaviours.path.nearby import RecentObstacles
from tests.behaviours.path.test_survey import RING
from uav_bt.testing.world import drawn_map
from uav_bt.types.site_map import MapObject, SiteMap

ORIGIN = 30, 30  # the cell at (0, 0)
X, Y = np.indices((61, 61)) * 0.1 - 3.0
NONE = RecentObstacles()


def clearance(site_map: SiteMap) -> ClearanceMap:
    return ClearanceMap(site_map, NONE)


def test_the_nearest_of_mapped_and_recent_obstacles_counts() -> None:
    site_map = drawn_map(obstacles=np.array([[1.0, 0.0]]))
    assert Distances(site_map, NONE).obstacle_m[ORIGIN] == pytest.approx(1.0)
    recent = RecentObstacles(seen_m=np.array([[0.0, -0.4]]))
    assert Distances(site_map, recent).obstacle_m[ORIGIN] == pytest.approx(0.4)
    assert Distances(drawn_map(), NONE).obstacle_m[ORIGIN] == math.inf


def test_an_object_is_solid_on_all_sides() -> None:
    box = MapObject(class_id=1, x_m=0.0, y_m=1.0, size_m=0.6, width_m=0.6, std_m=0.0, seen_s=1.0)
    found = Distances(replace(drawn_map(), objects=(box,)), NONE)
    assert (found.obstacle_m[28:33, 38:43] == 0.0).all()  # up to 0.25 m from its middle
    assert found.obstacle_m[30, 35] > 0.0
    turned = replace(box, size_m=0.8, width_m=0.4, yaw_rad=math.pi / 2)
    found = Distances(replace(drawn_map(), objects=(turned,)), NONE)
    for row, column, distance_m in ((30, 30, 0.6), (30, 50, 0.6), (40, 40, 0.8), (30, 40, 0.0)):
        assert found.obstacle_m[row, column] == pytest.approx(distance_m, abs=0.11)


def test_the_outside_and_edge_points_are_edges() -> None:
    # The ground ends 2 m from the origin, so the first outside cell is 2.1 m away.
    assert Distances(drawn_map(), NONE).edge_m[ORIGIN] == pytest.approx(2.1)
    recent = RecentObstacles(edges_m=np.array([[0.0, 1.5], [50.0, 50.0]]))
    assert Distances(drawn_map(), recent).edge_m[ORIGIN] == pytest.approx(1.5)
    ahead = RecentObstacles(edges_m=np.array([[0.6, y_m] for y_m in np.arange(-0.5, 0.55, 0.05)]))
    beside = drawn_map().cell_of(0.5, 0.0)
    assert clearance(drawn_map()).open[beside]
    assert not ClearanceMap(drawn_map(), ahead).open[beside]


def test_lanes_count_apart_from_obstacles() -> None:
    site_map = replace(drawn_map(), lanes_m=np.array([[-0.7, 0.0]]))
    found = Distances(site_map, NONE)
    assert found.lane_m[ORIGIN] == pytest.approx(0.7)
    assert found.obstacle_m[ORIGIN] == math.inf
    assert not ClearanceMap(site_map, NONE).roomy[24, 30]


def test_views_that_are_off_the_map_widen_the_distances() -> None:
    margins = Margins()
    assert margins.by(0.016) == margins
    unsure = margins.by(0.026)
    assert (unsure.touch_m, unsure.edge_m) == pytest.approx((0.48, 0.38))
    assert margins.by(1.0).touch_m == pytest.approx(0.52)
    site_map = drawn_map(obstacles=np.array([[1.0, 0.0]]))
    assert clearance(replace(site_map, residual_m=0.05)).open.sum() < clearance(site_map).open.sum()


def test_walls_all_round_shut_in() -> None:
    assert clearance(drawn_map(obstacles=0.8 * RING)).shut_in
    assert not clearance(drawn_map()).shut_in


def test_the_unknown_is_kept_away_from_on_all_sides_alike() -> None:
    hidden = (np.abs(X) < 0.25) & (np.abs(Y) < 0.25)
    clear_m = clearance(drawn_map(known=~hidden, pose=(-1.5, -1.5, 0.0))).clear_m
    assert np.array_equal(clear_m, clear_m[::-1])
    assert np.array_equal(clear_m, clear_m[:, ::-1])
    assert clear_m[30, 36] == pytest.approx(0.4 + 0.4 - Margins.unknown_m)
    # A single cell that no ray has met is not unknown.
    speck = (np.abs(X) < 0.05) & (np.abs(Y) < 0.05)
    found = clearance(drawn_map(known=~speck, pose=(-1.5, -1.5, 0.0)))
    assert found.clear_m[30, 31] > Margins.wide_m
