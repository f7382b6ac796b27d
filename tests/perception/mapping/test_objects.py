"""Objects made of the map's points: where their bases lie, and how large they are."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from perception.mapping.landmarks import Landmarks
from perception.mapping.objects import ObjectConfig, _closeness, find_objects
from tests.paper_lab import BOXES
from uav_bt.types import rotation
from uav_bt.types.site_map import MapObject


def object_of(points_m: list[tuple[float, float]]) -> MapObject:
    (found,) = find_objects(landmarks(points_m, class_id=BOXES[0]), BOXES)
    return found


def landmarks(points_m: list[tuple[float, float]], *, class_id: int) -> Landmarks:
    """Return points seen from the origin for a second."""
    zeros = np.zeros(len(points_m))
    return Landmarks(
        xy_m=np.array(points_m),
        weight=zeros + 1.0,
        first_s=zeros,
        seen_s=zeros + 1.0,
        settled_s=zeros,
        from_m=np.zeros((len(points_m), 2)),
        ids=np.full(len(points_m), class_id, dtype=np.uint8),
        missed=zeros,
    )


def side(first: tuple[float, float], last: tuple[float, float]) -> list[tuple[float, float]]:
    return [(float(x), float(y)) for x, y in np.linspace(first, last, 7)]


@pytest.mark.parametrize("turn_deg", [0, 25, 60, 90, 140])
def test_two_sides_make_the_whole_base(turn_deg: int) -> None:
    turn = math.radians(turn_deg)
    cos, sin = math.cos(turn), math.sin(turn)
    corners = [(-0.3, 0.2), (-0.3, -0.2), (0.3, -0.2), (0.3, 0.2)]
    placed = [(2.0 + cos * x - sin * y, sin * x + cos * y) for x, y in corners]
    found = object_of(side(placed[0], placed[1]) + side(placed[1], placed[2]))
    assert (found.x_m, found.y_m) == pytest.approx((2.0, 0.0), abs=0.01)
    assert (found.size_m, found.width_m) == pytest.approx((0.6, 0.4), abs=0.03)
    for corner in placed:
        assert np.linalg.norm(found.corners_m() - corner, axis=1).min() < 0.03


def test_one_side_is_as_deep_as_boxes_are_away_from_where_it_was_seen() -> None:
    depth_m = ObjectConfig().depth_m
    found = object_of(side((1.0, -0.25), (1.0, 0.25)))
    assert (found.x_m, found.y_m) == pytest.approx((1.0 + depth_m / 2, 0.0), abs=0.01)
    assert found.corners_m()[:, 0].min() == pytest.approx(1.0, abs=0.01)
    assert found.corners_m()[:, 0].max() == pytest.approx(1.0 + depth_m, abs=0.01)


def test_opposite_sides_are_one_object() -> None:
    """Each alone has the assumed depth, with which it overlaps the other one."""
    near, far = side((1.0, -0.25), (1.0, 0.25)), side((1.45, -0.25), (1.45, 0.25))
    points = landmarks([*near, *far], class_id=BOXES[0])
    from_m = np.array([(0.0, 0.0)] * len(near) + [(3.0, 0.0)] * len(far))
    (found,) = find_objects(replace(points, from_m=from_m), BOXES)
    assert (found.x_m, found.y_m) == pytest.approx((1.225, 0.0), abs=0.01)
    assert sorted((found.size_m, found.width_m)) == pytest.approx([0.45, 0.5], abs=0.01)
    assert found.points == len(near) + len(far)


def test_a_few_points_of_a_third_side_belong_to_the_object() -> None:
    """They lie 0.35 m from the others, and their base extends away from where they were seen."""
    sides = [*side((1.0, -0.2), (1.0, 0.2)), *side((1.0, -0.2), (1.2, -0.2))]
    third = [(1.45, 0.1), (1.45, 0.14), (1.45, 0.18), (1.45, 0.2)]
    points = landmarks([*sides, *third], class_id=BOXES[0])
    from_m = np.array([(0.0, 0.0)] * len(sides) + [(3.0, 1.0)] * len(third))
    (found,) = find_objects(replace(points, from_m=from_m), BOXES)
    assert found.size_m == pytest.approx(0.45, abs=0.02)


def test_boxes_of_one_class_side_by_side_are_two_objects() -> None:
    sides = [*side((1.0, -0.25), (1.0, 0.25)), *side((1.0, 0.6), (1.0, 1.1))]
    assert len(find_objects(landmarks(sides, class_id=BOXES[0]), BOXES)) == 2


def test_a_margin_moves_all_sides() -> None:
    found = object_of(side((1.0, -0.25), (1.0, 0.25)))
    inner, outer = found.corners_m(margin_m=-0.05), found.corners_m()
    assert np.ptp(outer, axis=0) - np.ptp(inner, axis=0) == pytest.approx([0.1, 0.1])


def test_the_classes_that_stand_make_objects_and_no_others() -> None:
    points = landmarks(side((1.0, -0.25), (1.0, 0.25)), class_id=2)
    (found,) = find_objects(points, [2])
    assert found.class_id == 2
    assert find_objects(points, [4]) == ()


def test_closeness_is_the_sum_of_inverse_distances_to_the_nearest_sides() -> None:
    points_m = np.random.default_rng(6).uniform(-1.0, 1.0, (30, 2))
    yaws = np.linspace(0.0, 1.5, 7)
    axes = np.stack([rotation(yaw) for yaw in yaws])
    along_m = points_m @ axes
    to_low_m = along_m - along_m.min(axis=1, keepdims=True)
    to_high_m = along_m.max(axis=1, keepdims=True) - along_m
    to_side_m = np.minimum(to_low_m, to_high_m).min(axis=-1)
    expected = (1.0 / np.maximum(to_side_m, 0.02)).sum(axis=1)
    assert _closeness(points_m, axes, 0.02) == pytest.approx(expected, rel=1e-9)


def on_legs(
    points_m: list[tuple[float, float]], from_m: tuple[float, float] = (0.0, 0.0)
) -> tuple[MapObject, ...]:
    """Return the objects of points of a class with legs up to 1.3 m apart."""
    legs_m = np.zeros(BOXES[0] + 1)
    legs_m[BOXES[0]] = 1.3
    points = landmarks(points_m, class_id=BOXES[0])
    seen_from = replace(points, from_m=np.tile(from_m, (len(points), 1)))
    return find_objects(seen_from, BOXES[:1], legs_m=legs_m)


def legs_at(x_m: float, y_m: float, turn_deg: float) -> list[tuple[float, float]]:
    """Return four legs, 1.05 m and 0.55 m apart."""
    corners_m = np.array([(0.525, 0.275), (-0.525, 0.275), (-0.525, -0.275), (0.525, -0.275)])
    placed_m = corners_m @ rotation(math.radians(turn_deg)).T + (x_m, y_m)
    return [(float(x), float(y)) for x, y in placed_m]


@pytest.mark.parametrize("turn_deg", [0, 30, 75, 120])
def test_four_legs_are_the_corners_of_one_object(turn_deg: int) -> None:
    legs_m = legs_at(2.0, 1.0, turn_deg)
    (found,) = on_legs(legs_m)
    assert (found.x_m, found.y_m) == pytest.approx((2.0, 1.0), abs=0.02)
    assert (found.size_m, found.width_m) == pytest.approx((1.05, 0.55), abs=0.04)
    for leg_m in legs_m:
        assert np.linalg.norm(found.corners_m() - leg_m, axis=1).min() < 0.03
    assert not find_objects(landmarks(legs_m, class_id=BOXES[0]), BOXES)


def test_two_legs_are_the_near_side_of_an_object() -> None:
    """It extends away from the camera by the depth of boxes."""
    (found,) = on_legs([(1.5, -0.5), (1.5, 0.5)])
    assert found.size_m == pytest.approx(1.0, abs=0.01)
    assert found.x_m == pytest.approx(1.5 + ObjectConfig().depth_m / 2, abs=0.01)
    assert found.covers(1.6, 0.0)


def test_legs_of_two_tables_are_two_objects() -> None:
    found = on_legs([*legs_at(2.0, 1.0, 20), *legs_at(3.4, 1.6, -10)])
    assert sorted(round(each.x_m, 1) for each in found) == [2.0, 3.4]


def test_one_leg_is_no_object() -> None:
    assert not on_legs([(1.5, -0.5)])


def test_a_table_with_displaced_points_is_one_object() -> None:
    """A few points lie up to 0.4 m beside their legs, so that the ends are 1.7 m apart."""
    displaced = [(1.1, 0.9), (1.2, 1.2), (2.8, 1.35)]
    again = [(x_m + 0.06, y_m - 0.05) for x_m, y_m in legs_at(2.0, 1.0, 0)]
    (found,) = on_legs([*legs_at(2.0, 1.0, 0), *again, *displaced])
    assert (found.x_m, found.y_m) == pytest.approx((2.0, 1.0), abs=0.2)
    assert found.points >= 8
