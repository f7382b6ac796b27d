"""View points around an object on drawn maps: spread, order, room and line of sight."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from behaviours.path.margins import Margins, Passage
from behaviours.path.nearby import RecentObstacles
from behaviours.path.passages import ClearanceMaps
from behaviours.path.view_points import SIGHT_M, view_points
from tests.behaviours.path.drawn_maps import MARK, corner
from uav_bt.testing.world import drawn_map
from uav_bt.types import Pose2D
from uav_bt.types.site_map import MapObject, SiteMap

NOTHING = np.empty((0, 2))
AT_M = (-1.5, -1.5)  # the drone


def box(x_m: float, y_m: float, *, yaw_deg: float = 0.0, class_id: int = 4) -> MapObject:
    place = {"x_m": x_m, "y_m": y_m, "yaw_rad": math.radians(yaw_deg), "std_m": 0.05}
    return MapObject(class_id=class_id, size_m=0.5, width_m=0.3, seen_s=1.0, **place)


def map_with(
    *objects: MapObject,
    obstacles: NDArray[np.float64] = NOTHING,
    pose: tuple[float, float, float] = (*AT_M, 0.0),
) -> SiteMap:
    """Return the drawn map with objects, whose outlines are among its obstacles."""
    outlines_m = [each.outline_m(0.08) for each in objects]
    drawn = drawn_map(obstacles=np.vstack([obstacles, *outlines_m]), pose=pose)
    return replace(drawn, objects=objects)


def around(
    target: MapObject, site_map: SiteMap, *, distance_m: float = 0.8, count: int = 4
) -> list[Pose2D]:
    maps = ClearanceMaps(site_map, RecentObstacles(), Margins())
    return view_points(maps, target, distance_m=distance_m, count=count)


def distance_m(item: MapObject, pose: Pose2D) -> float:
    """Return the distance of a pose from the side of an object."""
    along_m, across_m = Pose2D(x_m=item.x_m, y_m=item.y_m, yaw_rad=item.yaw_rad).to_body(
        pose.x_m, pose.y_m
    )
    return math.hypot(max(abs(along_m) - 0.25, 0.0), max(abs(across_m) - 0.15, 0.0))


def bearing_error_rad(item: MapObject, pose: Pose2D) -> float:
    to_item_rad = math.atan2(item.y_m - pose.y_m, item.x_m - pose.x_m)
    return abs(math.remainder(to_item_rad - pose.yaw_rad, math.tau))


@pytest.mark.parametrize("yaw_deg", [0.0, 30.0])
def test_four_places_face_the_four_sides(yaw_deg: float) -> None:
    target = box(0.0, 0.0, yaw_deg=yaw_deg)
    poses = around(target, map_with(target))
    assert len(poses) == 4
    for pose in poses:
        assert distance_m(target, pose) == pytest.approx(0.8, abs=1e-6)
        assert bearing_error_rad(target, pose) < 1e-6
        quarters = (pose.yaw_rad - target.yaw_rad) / (math.pi / 2)
        assert quarters == pytest.approx(round(quarters), abs=1e-6)


def apart_m(pose: Pose2D, x_m: float, y_m: float) -> float:
    return math.dist((pose.x_m, pose.y_m), (x_m, y_m))


def test_the_tour_begins_nearest_to_the_drone_and_goes_round() -> None:
    """A single place is at the side that faces the drone."""
    target = box(0.0, 0.0)
    poses = around(target, map_with(target), count=6)
    from_drone_m = [apart_m(each, *AT_M) for each in poses]
    assert len(poses) == 6
    assert from_drone_m[0] < min(from_drone_m[1:])
    assert max(apart_m(a, b.x_m, b.y_m) for a, b in itertools.pairwise(poses)) < 1.3
    (pose,) = around(target, map_with(target, pose=(1.6, 0.2, 0.0)), count=1)
    assert (pose.x_m, pose.y_m) == pytest.approx((0.25 + 0.8, 0.0))


def test_a_place_beside_is_taken_where_a_wanted_one_has_no_room() -> None:
    """There are fewer at the edge of the ground."""
    target, other = box(0.0, 0.0), box(1.1, 0.0, class_id=5)
    poses = around(target, map_with(target, other))
    assert len(poses) == 4
    beside = next(each for each in poses if each.x_m > 0.5)
    assert abs(beside.y_m) > 0.3
    assert bearing_error_rad(target, beside) < 1e-6
    at_edge = box(1.7, 0.0)
    poses = around(at_edge, map_with(at_edge))
    assert 2 <= len(poses) <= 3
    assert all(each.x_m < 1.71 for each in poses)


def test_nothing_between_the_place_and_the_object() -> None:
    target, post = box(0.0, 0.0), np.array([[-0.75, 0.0], [-0.75, 0.05], [-0.75, -0.05]])
    poses = around(target, map_with(target, obstacles=post), distance_m=1.3)
    assert len(poses) >= 3
    for pose in poses:
        line_m = np.linspace((pose.x_m, pose.y_m), (target.x_m, target.y_m), 60)
        assert np.hypot(*(line_m - post[0]).T).min() >= SIGHT_M - 0.03


def test_an_object_whose_outline_was_not_seen_hides_what_is_behind_it() -> None:
    """Only the base of the other box is on the map, not its points."""
    target = box(0.0, 0.0)
    other = replace(box(-0.7, 0.0, class_id=5), size_m=0.2, width_m=0.2)
    hidden = replace(map_with(target), objects=(target, other))
    poses = around(target, hidden, distance_m=1.3, count=1)
    assert len(poses) == 1
    assert not (poses[0].x_m < -0.9 and abs(poses[0].y_m) < 0.1)


def test_a_place_without_a_size_is_looked_at_from_the_drones_side() -> None:
    spot = replace(box(0.5, 0.5), size_m=0.0, width_m=0.0)
    poses = around(spot, map_with(), count=3)
    assert len(poses) == 3
    assert [apart_m(each, 0.5, 0.5) for each in poses] == pytest.approx([0.8] * 3)
    to_drone_rad = math.atan2(-1.5 - 0.5, -1.5 - 0.5)
    assert math.atan2(poses[0].y_m - 0.5, poses[0].x_m - 0.5) == pytest.approx(to_drone_rad)


def test_ground_that_cannot_be_reached_has_no_view_points() -> None:
    wall = np.column_stack([np.arange(-2.2, 2.3, 0.05), np.full(90, -0.6)])
    target = box(0.0, 0.9)
    assert around(target, map_with(target, obstacles=wall)) == []
    assert around(target, map_with(target, obstacles=wall, pose=(-1.2, 0.5, 0.0)))


def test_places_to_which_only_a_drone_that_is_shut_in_flies_are_no_view_points() -> None:
    """The object stands in a corner behind a gap that no other passage leads through."""
    for gap_m, seen in ((0.5, False), (1.0, True)):
        target = replace(box(-1.6, 1.5), size_m=0.1, width_m=0.1)
        site_map = replace(corner(gap_m, at=MARK), objects=(target,))
        assert bool(around(target, site_map, distance_m=0.4, count=8)) == seen


@given(
    st.lists(st.tuples(st.floats(-2, 2), st.floats(-2, 2)), max_size=12),
    st.floats(-math.pi, math.pi),
    st.floats(0.4, 1.5),
    st.integers(1, 12),
)
def test_every_view_point_has_room_a_free_view_and_about_the_distance(
    places: list[tuple[float, float]], yaw_rad: float, wanted_m: float, count: int
) -> None:
    target = replace(box(0.2, -0.1), yaw_rad=yaw_rad)
    far = [p for p in places if math.dist(p, (0.2, -0.1)) > 0.6 and math.dist(p, AT_M) > 0.7]
    obstacles = np.array(far, dtype=float).reshape(-1, 2)
    site_map = map_with(target, obstacles=obstacles)
    poses = around(target, site_map, distance_m=wanted_m, count=count)
    maps = ClearanceMaps(site_map, RecentObstacles(), Margins())
    touch_m = maps[Passage.ORDINARY].margins.touch_m
    assert len(poses) <= count
    for index, pose in enumerate(poses):
        assert 0.7 * 0.8 * wanted_m <= distance_m(target, pose) <= 1.2 * wanted_m + 1e-6
        assert bearing_error_rad(target, pose) < 1e-6
        line_m = np.linspace((pose.x_m, pose.y_m), (target.x_m, target.y_m), 80)
        for place in obstacles:
            assert apart_m(pose, *place) >= touch_m - 0.03
            assert np.hypot(*(line_m - place).T).min() >= SIGHT_M - 0.05
        assert all(apart_m(pose, other.x_m, other.y_m) > 0.02 for other in poses[:index])
