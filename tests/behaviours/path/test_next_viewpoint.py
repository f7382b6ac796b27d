"""The next viewpoint: the value of views, and obstacles before it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from behaviours.path.clearance import ClearanceMap
from behaviours.path.nearby import RecentObstacles
from behaviours.path.next_viewpoint import (
    GroundInView,
    Viewpoint,
    ViewpointConfig,
    best_viewpoint,
    shown_by,
    still_shows_m2,
    unseen,
)
from tests.behaviours.path.test_survey import where
from uav_bt.testing.world import drawn_map
from uav_bt.types import CameraModel
from uav_bt.types.arrays import Flags
from uav_bt.types.site_map import SiteMap

CONFIG = ViewpointConfig()
SIGHT = GroundInView(near_m=0.8, far_m=3.0, half_rad=math.radians(34))
WALL = np.column_stack([np.arange(-2.2, 2.3, 0.05), np.full(90, 0.5)])


def around(cells: NDArray[np.bool_], site_map: SiteMap, *, beyond: bool = False) -> Flags:
    """Return cells of a map as wanted cells, with the margin that views reach beyond the map."""
    return np.pad(cells, CONFIG.around_cells(site_map.cell_m), constant_values=beyond)


def room_of(site_map: SiteMap) -> ClearanceMap:
    return ClearanceMap(site_map, RecentObstacles())


def test_the_sight_follows_from_camera_pitch_and_height() -> None:
    """Rows 45 degrees above and below the middle: a camera 60 degrees down sees to 75 and 15."""
    camera = CameraModel(width_px=200, height_px=200, fx_px=100, fy_px=100, cx_px=100, cy_px=100)
    sight = GroundInView.of(camera, math.radians(-60), 1.5, 9.0)
    assert sight.near_m == 0.0
    assert sight.far_m == pytest.approx(1.5 / math.tan(math.radians(15)))
    assert sight.half_rad == pytest.approx(math.pi / 4)
    level = GroundInView.of(camera, math.radians(-30), 1.5, 3.5)
    assert level.near_m == pytest.approx(1.5 / math.tan(math.radians(75)))
    assert level.far_m == 3.5


@pytest.mark.parametrize(("half", "side"), [("left", -1.0), ("right", 1.0)])
def test_it_looks_to_the_half_that_was_not_seen(half: str, side: float) -> None:
    clearance = room_of(drawn_map())
    wanted = around(where(half), clearance.map) & unseen(clearance, math.inf, CONFIG)
    view = best_viewpoint(clearance, wanted, SIGHT, CONFIG)
    assert view is not None
    assert side * (view.y_m + 1.5 * math.sin(view.yaw_rad)) > 0.2
    assert view.shows_m2 > 1.0


def test_what_was_seen_is_not_looked_at_until_the_search_begins_anew() -> None:
    clearance = room_of(drawn_map())
    inside = around(np.abs(clearance.map.places_m()).max(axis=-1) < 1.95, clearance.map)
    assert not (unseen(clearance, -math.inf, CONFIG) & inside).any()
    assert (unseen(clearance, 2.0, CONFIG) & inside).sum() == inside.sum()
    assert best_viewpoint(clearance, unseen(clearance, -math.inf, CONFIG), SIGHT, CONFIG) is None


def test_what_the_map_does_not_reach_is_wanted_too() -> None:
    clearance = room_of(drawn_map())
    beyond = around(np.zeros_like(clearance.open), clearance.map, beyond=True)
    assert unseen(clearance, -math.inf, CONFIG)[beyond].all()


def test_nothing_is_seen_through_an_obstacle() -> None:
    behind = drawn_map(obstacles=WALL, pose=(0.0, -0.3, math.pi / 2))
    clearance = room_of(behind)
    wanted = unseen(clearance, math.inf, CONFIG) & around(behind.places_m()[..., 1] > 0.7, behind)
    across = Viewpoint(x_m=0.0, y_m=-0.3, yaw_rad=math.pi / 2, shows_m2=9.0)
    assert still_shows_m2(across, clearance, wanted, SIGHT, CONFIG) == 0.0
    assert best_viewpoint(clearance, wanted, SIGHT, CONFIG) is None
    open_ = room_of(drawn_map(pose=(0.0, -0.3, math.pi / 2)))
    assert still_shows_m2(across, open_, wanted, SIGHT, CONFIG) > 1.0


def test_nothing_is_looked_at_beyond_the_edge_of_the_ground() -> None:
    clearance = room_of(drawn_map())
    wanted = around(clearance.map.outside, clearance.map)
    assert best_viewpoint(clearance, wanted, SIGHT, CONFIG) is None


def test_what_a_view_shows_is_where_it_looks() -> None:
    clearance = room_of(drawn_map())
    ahead = Viewpoint(x_m=-1.0, y_m=0.0, yaw_rad=0.0, shows_m2=1.0)
    shown = shown_by(ahead, clearance, SIGHT, CONFIG) - (-1.0, 0.0)
    ranges = np.hypot(*shown.T)
    assert ranges.min() >= SIGHT.near_m - 0.1
    assert ranges.max() <= SIGHT.far_m + 0.1
    assert np.abs(np.arctan2(shown[:, 1], shown[:, 0])).max() <= SIGHT.half_rad + 0.1


def test_a_view_counts_its_ground_about_right() -> None:
    """A sector of 68 degrees between 0.8 and 3 m, all of it on the ground: 4.8 m2."""
    clearance = room_of(drawn_map())
    view = Viewpoint(x_m=-1.5, y_m=0.0, yaw_rad=0.0, shows_m2=1.0)
    wanted = around(np.ones_like(clearance.open), clearance.map)
    area_m2 = 0.5 * (3.0**2 - 0.8**2) * 2 * math.radians(34)
    shown_m2 = still_shows_m2(view, clearance, wanted, SIGHT, CONFIG)
    assert shown_m2 == pytest.approx(area_m2, rel=0.15)
