"""Following a route, and where the camera points on it."""

import math
from dataclasses import replace

import numpy as np
import pytest

from behaviours.path.clearance import ClearanceMap
from behaviours.path.following import follow
from behaviours.path.gimbal_pointing import (
    ground_pitch_rad,
    ground_share,
    mark_pitch_rad,
    mover_pitch_rad,
)
from behaviours.path.margins import Margins
from behaviours.path.nearby import RecentObstacles, recent_obstacles
from behaviours.path.survey import best_route
from tests.behaviours.path.drawn_maps import mover, where, with_movers
from tests.behaviours.policies.cast_world import CAMERA
from tests.worlds import values
from uav_bt.answers import FollowLeg
from uav_bt.testing.world import drawn_map
from uav_bt.types import NearObstacles

MARGINS = Margins()
AHEAD = np.array([0.1, 0.0])
BOX = np.array([[1.0, y_m] for y_m in np.arange(-0.2, 0.25, 0.1)])


def seen(points_m: np.ndarray, edges_m: np.ndarray | None = None) -> NearObstacles:
    edges = np.empty((0, 2)) if edges_m is None else edges_m
    return NearObstacles(points_m=points_m, edges_m=edges, captured_s=1.0)


def test_what_the_map_shows_too_is_where_the_map_shows_it() -> None:
    """The memory has drifted by a decimetre since: it must not make the box larger."""
    lately = recent_obstacles(seen(BOX - AHEAD, BOX + AHEAD), drawn_map(obstacles=BOX))
    assert not len(lately.seen_m)
    assert len(lately.edges_m) == len(BOX)  # the map knows of no edge there
    mapped = replace(drawn_map(), edges_m=BOX)
    assert not len(recent_obstacles(seen(BOX, BOX + AHEAD), mapped).edges_m)


def test_what_is_not_on_the_map_counts_from_where_the_drone_is() -> None:
    lately = recent_obstacles(seen(BOX), drawn_map(pose=(0.5, 0.0, math.pi / 2)))
    assert np.allclose(lately.seen_m, np.column_stack([0.5 - BOX[:, 1], BOX[:, 0]]))


@pytest.mark.parametrize(("age_s", "counts"), [(2.0, True), (4.0, False)])
def test_what_the_map_does_not_show_on_its_ground_counts_for_a_while(
    *, age_s: float, counts: bool
) -> None:
    """For planning; it may have been seen from a wrong place."""
    old = replace(
        seen(BOX, BOX), points_age_s=np.full(len(BOX), age_s), edges_age_s=np.full(len(BOX), age_s)
    )
    lately = recent_obstacles(old, drawn_map(), unmapped_s=3.0)
    assert (len(lately.seen_m) > 0, len(lately.edges_m) > 0) == (counts, counts)
    nothing = np.zeros((61, 61), dtype=bool)
    unseen = recent_obstacles(old, drawn_map(known=nothing), unmapped_s=3.0)
    assert len(unseen.seen_m) == len(BOX)  # nobody saw the ground
    away = recent_obstacles(old, drawn_map())  # what pushes away counts as before
    assert len(away.seen_m) == len(BOX)


def test_single_points_are_no_obstacle() -> None:
    lonely = np.array([[1.0, 1.0], [1.1, 1.0], [-1.0, -1.0]])
    assert not len(recent_obstacles(seen(lonely), drawn_map()).seen_m)
    assert len(recent_obstacles(seen(np.vstack([lonely, [[1.0, 1.1]]])), drawn_map()).seen_m) == 3
    assert recent_obstacles(None, drawn_map()).seen_m.shape == (0, 2)


def test_it_steers_around_a_corner_not_across_it() -> None:
    """Beside the corner of a block; 0.6 m further the path has gone round it."""
    block = np.array([(x, y) for x in np.arange(-1.0, 0.5, 0.05) for y in np.arange(0.4, 1.5, 0.1)])
    clearance = ClearanceMap(drawn_map(pose=(0.45, 0.0, 0.0), obstacles=block), RecentObstacles())
    ahead = [(x_m, 0.0) for x_m in (0.5, 0.6, 0.7, 0.8, 0.9)]
    path_m = ahead + [(0.9, y_m) for y_m in (0.1, 0.2, 0.3, 0.4, 0.5, 0.6)]
    leg = clearance.route_along([clearance.map.cell_of(*place_m) for place_m in path_m], time_s=3.0)
    way = follow(leg, clearance.map, None, margins=MARGINS)
    assert way is not None
    course = np.arange(0.0, 0.6, 0.05)[:, None] * (math.cos(way.yaw_rad), math.sin(way.yaw_rad))
    nearest_m = np.linalg.norm((0.45, 0.0) + course[:, None] - block, axis=-1).min()
    assert nearest_m >= leg.clear_m.min() - 0.03 - 0.05  # half a cell


def test_in_the_open_it_looks_far_ahead() -> None:
    leg = best_route(ClearanceMap(drawn_map(passed=where("left")), RecentObstacles()))
    assert leg is not None
    assert leg.straight_m == pytest.approx(np.minimum.accumulate(leg.clear_m), abs=0.15)


@pytest.mark.parametrize(
    ("x_m", "y_m", "free_m", "speed_mps"),
    [
        ((0.3, 0.4, 0.5), -0.45, 0.3, 0.15),  # mapped beside the way; the corridor is wider
        ((1.5, -0.3, 0.2), 1.2, 0.3, None),  # not on the map there
        ((0.5, 0.6, 0.7), -0.45, 0.27, None),  # nearer than anything on the map
        ((0.1, 0.2, 0.3), -0.45, 0.2, None),  # within the hull, mapped or not
    ],
)
def test_it_creeps_past_what_the_map_has_and_stops_before_what_it_lacks(
    x_m: tuple[float, ...], y_m: float, free_m: float, speed_mps: float | None
) -> None:
    """Straight ahead, with a corridor that is blocked at a near distance."""
    obstacles = np.array([[x, y_m] for x in x_m])
    clearance = ClearanceMap(drawn_map(obstacles=obstacles), RecentObstacles())
    path = [clearance.map.cell_of(x, 0.0) for x in np.arange(0.0, 1.0, 0.1)]
    leg = clearance.route_along(path, time_s=3.0)
    corridor = values.corridor(free_m, "left", captured_s=1.0)
    way = follow(leg, clearance.map, corridor, margins=MARGINS)
    assert (way.speed_mps if isinstance(way, FollowLeg) else way) == speed_mps


# --- where the camera looks -----------------------------------------------------------------------

FLIGHT_RAD = math.radians(-30)
LOWEST_RAD = math.radians(-50)


@pytest.mark.parametrize(
    ("range_m", "expected_rad"),
    [(3.0, FLIGHT_RAD), (1.5, -math.atan2(1.1, 1.5)), (0.2, LOWEST_RAD)],
)
def test_the_camera_follows_the_mark_down(range_m: float, expected_rad: float) -> None:
    assert mark_pitch_rad(range_m, 1.1, FLIGHT_RAD) == pytest.approx(expected_rad)


@pytest.mark.parametrize(("range_m", "base_deg"), [(2.0, 40.6), (1.25, 56.3), (0.6, 76.9)])
def test_the_base_of_the_nearest_mover_stays_in_view(range_m: float, base_deg: float) -> None:
    near = with_movers(mover(0.0, range_m), mover(-3.0, 0.0))
    pitch_deg = math.degrees(mover_pitch_rad(near, FLIGHT_RAD, 1.5))
    assert -56.0 <= pitch_deg <= -30.0
    assert -base_deg > pitch_deg - 21.0  # half of the view is 20 degrees high


def test_at_the_edge_the_camera_looks_down_to_the_ground_before_it() -> None:
    for x_m, y_m, yaw_deg, flight_deg, pitch_deg in (
        (-1.5, 0.0, 0, -30, -30),
        (0.0, 1.4, 60, -30, -56),  # 0.6 m from the edge the view in flight begins beyond it
        (0.0, 1.4, 90, -30, -56),
        (0.0, 1.4, 120, -30, -56),
        (0.0, 1.8, 90, -70, -70),  # it looks down further in flight
        (0.0, 4.0, -90, -30, -30),  # the ground lies further away than a lowered camera shows,
    ):
        site_map = drawn_map(pose=(x_m, y_m, math.radians(yaw_deg)))
        flight_rad, expected_rad = math.radians(flight_deg), math.radians(pitch_deg)
        pitch_rad = ground_pitch_rad(site_map, CAMERA, flight_rad, 1.5)
        assert pitch_rad == pytest.approx(expected_rad)
        before, after = (
            ground_share(site_map, CAMERA, rad, 1.5) for rad in (flight_rad, pitch_rad)
        )
        assert after > before or pitch_rad == flight_rad


@pytest.mark.parametrize("height_m", [0.8, 1.5])
def test_in_the_open_it_looks_ahead_at_any_height(height_m: float) -> None:
    inside = drawn_map(pose=(-1.8, 0.0, 0.0))
    assert ground_pitch_rad(inside, CAMERA, FLIGHT_RAD, height_m) == FLIGHT_RAD
