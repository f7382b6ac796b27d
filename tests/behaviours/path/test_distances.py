"""Distances of cells from obstacles, edges and lanes, computed by hand."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from behaviours.path.clearance import Distances
from behaviours.path.nearby import RecentObstacles
from uav_bt.testing.world import drawn_map
from uav_bt.types.site_map import MapObject

ORIGIN = 30, 30  # the cell at (0, 0)


def test_the_nearest_of_mapped_and_recent_obstacles_counts() -> None:
    site_map = drawn_map(obstacles=np.array([[1.0, 0.0]]))
    assert Distances(site_map, RecentObstacles()).obstacle_m[ORIGIN] == pytest.approx(1.0)
    recent = RecentObstacles(seen_m=np.array([[0.0, -0.4]]))
    assert Distances(site_map, recent).obstacle_m[ORIGIN] == pytest.approx(0.4)
    assert Distances(drawn_map(), RecentObstacles()).obstacle_m[ORIGIN] == math.inf


def test_an_object_is_filled() -> None:
    box = MapObject(class_id=1, x_m=0.0, y_m=1.0, size_m=0.6, width_m=0.6, std_m=0.0, seen_s=1.0)
    found = Distances(replace(drawn_map(), objects=(box,)), RecentObstacles())
    assert (found.obstacle_m[28:33, 38:43] == 0.0).all()  # up to 0.25 m from its middle
    assert found.obstacle_m[30, 35] > 0.0


def test_the_outside_and_edge_points_are_edges() -> None:
    # The ground ends 2 m from the origin, so the first outside cell is 2.1 m away.
    assert Distances(drawn_map(), RecentObstacles()).edge_m[ORIGIN] == pytest.approx(2.1)
    recent = RecentObstacles(edges_m=np.array([[0.0, 1.5], [50.0, 50.0]]))
    assert Distances(drawn_map(), recent).edge_m[ORIGIN] == pytest.approx(1.5)


def test_lanes_count_apart_from_obstacles() -> None:
    site_map = replace(drawn_map(), lanes_m=np.array([[-0.7, 0.0]]))
    found = Distances(site_map, RecentObstacles())
    assert found.lane_m[ORIGIN] == pytest.approx(0.7)
    assert found.obstacle_m[ORIGIN] == math.inf
