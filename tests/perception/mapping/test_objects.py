"""Objects of the map, and those that are known beforehand."""

import math
from dataclasses import replace

import numpy as np
import pytest

from perception.mapping import known_objects
from perception.mapping.known_objects import KnownObjects
from perception.mapping.landmarks import Landmarks
from perception.mapping.objects import _DEPTH_M, find_objects
from tests.paper_lab import BOXES
from tests.perception.mapping.mapping_world import points
from uav_bt.types import Pose2D
from uav_bt.types.site_map import MapObject

Points = list[tuple[float, float]]


def landmarks(points_m: Points, from_m: object = (0.0, 0.0)) -> Landmarks:
    """Return points of a box that were seen for a second."""
    found = points(*points_m, class_id=BOXES[0])
    seen_from = np.broadcast_to(np.array(from_m), found.xy_m.shape)
    return replace(found, seen_s=found.seen_s + 1.0, from_m=seen_from)


def objects(found: Landmarks, legs_apart_m: float = 0.0) -> tuple[MapObject, ...]:
    return find_objects(found, BOXES, np.full(BOXES[-1] + 1, legs_apart_m))


def on_legs(points_m: Points) -> tuple[MapObject, ...]:
    """Return the objects of points of a class with legs up to 1.3 m apart."""
    return objects(landmarks(points_m), 1.3)


def side(first: tuple[float, float], last: tuple[float, float]) -> Points:
    return [(float(x), float(y)) for x, y in np.linspace(first, last, 7)]


def corners(x_m: float, y_m: float, turn_deg: float, halves_m: tuple[float, float]) -> Points:
    """Return the corners of a rectangle in the order of a walk around it."""
    return Pose2D(x_m=x_m, y_m=y_m, yaw_rad=math.radians(turn_deg)).rectangle(*halves_m)


FRONT = side((1.0, -0.25), (1.0, 0.25))
LEGS_M = (0.525, 0.275)  # half of the distances between legs


@pytest.mark.parametrize("turn_deg", [0, 25, 60, 75, 90, 120, 140])
def test_two_sides_or_four_legs_make_the_whole_base(turn_deg: int) -> None:
    box, legs_m = (corners(2.0, 1.0, turn_deg, halves) for halves in ((0.3, 0.2), LEGS_M))
    sides = landmarks(side(box[1], box[2]) + side(box[2], box[3]))
    for (found,), placed_m, size_m in (
        (objects(sides), box, (0.6, 0.4)),
        (on_legs(legs_m), legs_m, (1.05, 0.55)),
    ):
        assert (found.x_m, found.y_m) == pytest.approx((2.0, 1.0), abs=0.02)
        assert (found.size_m, found.width_m) == pytest.approx(size_m, abs=0.04)
        for corner in placed_m:
            assert np.linalg.norm(found.corners_m() - corner, axis=1).min() < 0.03
    assert not objects(landmarks(legs_m))


def test_one_side_is_as_deep_as_boxes_are_away_from_where_it_was_seen() -> None:
    (found,) = objects(landmarks(FRONT))
    assert (found.x_m, found.y_m) == pytest.approx((1.0 + _DEPTH_M / 2, 0.0), abs=0.01)
    x_m = found.corners_m()[:, 0]
    assert (x_m.min(), x_m.max()) == pytest.approx((1.0, 1.0 + _DEPTH_M), abs=0.01)


def test_opposite_sides_are_one_object() -> None:
    """Each alone has the assumed depth, with which it overlaps the other one."""
    far = side((1.45, -0.25), (1.45, 0.25))
    from_m = [(0.0, 0.0)] * len(FRONT) + [(3.0, 0.0)] * len(far)
    (found,) = objects(landmarks(FRONT + far, from_m))
    assert (found.x_m, found.y_m) == pytest.approx((1.225, 0.0), abs=0.01)
    assert sorted((found.size_m, found.width_m)) == pytest.approx([0.45, 0.5], abs=0.01)
    assert found.points == len(FRONT) + len(far)
    assert len(objects(landmarks(FRONT + side((1.0, 0.6), (1.0, 1.1))))) == 2  # beside each other


def test_a_few_points_of_a_third_side_belong_to_the_object() -> None:
    """They lie 0.35 m from the others, and their base extends away from where they were seen."""
    sides = [*side((1.0, -0.2), (1.0, 0.2)), *side((1.0, -0.2), (1.2, -0.2))]
    third = [(1.45, 0.1), (1.45, 0.14), (1.45, 0.18), (1.45, 0.2)]
    (found,) = objects(landmarks(sides + third, [(0.0, 0.0)] * len(sides) + [(3.0, 1.0)] * 4))
    assert found.size_m == pytest.approx(0.45, abs=0.02)


def test_only_lasting_points_of_the_classes_that_stand_make_objects() -> None:
    found, legs_m = landmarks(FRONT), np.zeros(BOXES[-1] + 1)
    assert [each.class_id for each in find_objects(found, BOXES[:1], legs_m)] == [BOXES[0]]
    assert find_objects(found, BOXES[1:], legs_m) == ()
    assert objects(found.take(np.arange(3))) == ()
    assert objects(replace(found, seen_s=found.first_s + 0.2)) == ()


def test_two_legs_are_the_near_side_of_an_object_and_one_is_none() -> None:
    """It extends away from the camera by the depth of boxes."""
    (found,) = on_legs([(1.5, -0.5), (1.5, 0.5)])
    assert found.size_m == pytest.approx(1.0, abs=0.01)
    assert found.x_m == pytest.approx(1.5 + _DEPTH_M / 2, abs=0.01)
    assert not on_legs([(1.5, -0.5)])


def test_a_table_with_displaced_points_is_one_object() -> None:
    """A few points lie up to 0.4 m beside their legs, so that the ends are 1.7 m apart."""
    displaced = [(1.1, 0.9), (1.2, 1.2), (2.8, 1.35)]
    legs_m = corners(2.0, 1.0, 0, LEGS_M)
    again = [(x_m + 0.06, y_m - 0.05) for x_m, y_m in legs_m]
    (found,) = on_legs([*legs_m, *again, *displaced])
    assert (found.x_m, found.y_m) == pytest.approx((2.0, 1.0), abs=0.2)
    assert found.points >= 8
    two = on_legs([*corners(2.0, 1.0, 20, LEGS_M), *corners(3.4, 1.6, -10, LEGS_M)])
    assert sorted(round(each.x_m, 1) for each in two) == [2.0, 3.4]


# --- ids of objects through a mission -------------------------------------------------------------


def box(x_m: float, y_m: float = 0.0, class_id: int = 4) -> MapObject:
    return MapObject(
        class_id=class_id, x_m=x_m, y_m=y_m, size_m=0.4, width_m=0.4, std_m=0.1, seen_s=1.0
    )


def ids(known: KnownObjects, *found: MapObject) -> list[int]:
    return [each.id for each in known.named(found)]


@pytest.mark.parametrize(
    "searches",  # places of the boxes found, and their ids
    [
        pytest.param([{0.0: 1, 1.0: 2}, {1.1: 2, -0.1: 1}], id="stay"),
        pytest.param(
            [{0.0: 1, 2.0: 2}, {2.0: 2}, {}, {2.1: 2, 0.2: 1}], id="vanish and come again"
        ),
        pytest.param([{0.0: 1}, {}, {1.0: 2}], id="elsewhere"),
        pytest.param(
            [{0.0: 1, 0.7: 2}, {0.4: 2}, {0.4: 2}, {0.05: 1, 0.65: 2}],
            id="merge and split again",
        ),
        pytest.param([{0.0: 1}, {0.35: 2, -0.2: 1}], id="the nearest part of a split"),
        pytest.param(
            [{0.0: 1, 0.45: 2}, *({x_m: 2} for x_m in (0.45, 0.4, 0.3, 0.2, 0.1))],
            id="one that stands takes no id from one that vanished",
        ),
    ],
)
def test_ids_last_for_the_mission(searches: list[dict[float, int]]) -> None:
    known = KnownObjects()
    for places in searches:
        assert ids(known, *map(box, places)) == list(places.values())


def test_an_object_of_another_class_is_another_object() -> None:
    known = KnownObjects()
    assert ids(known, box(0.0), box(0.0, class_id=5)) == [1, 2]
    assert ids(known, box(0.1, class_id=5), box(-0.1), box(0.0, class_id=6)) == [2, 1, 3]


def test_after_a_restart_objects_are_found_in_the_frame_of_the_new_map() -> None:
    known = KnownObjects()
    known.named([box(1.0), box(2.0)])
    correction = Pose2D(x_m=0.5, y_m=-0.3, yaw_rad=math.radians(90))
    known.restart(correction)
    moved = [box(*correction.to_body(x_m + 0.3, 0.2)) for x_m in (2.0, 1.0)]
    assert ids(known, *moved) == [2, 1]


def test_the_height_is_the_median_over_views_and_outlives_an_absence(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    known, view = KnownObjects(), None
    known.named([box(0.0), box(3.0)])
    for height_m in (0.80, 0.82, 0.84, 3.0, 0.81):
        seen_m = np.array([height_m, math.nan])
        monkeypatch.setattr(known_objects, "upper_edges", lambda *_, seen_m=seen_m: seen_m)
        known.measure(view)
    known.named([])
    found, other = known.named([box(0.0), box(3.0)])
    assert found.height_m == pytest.approx(0.82)
    assert 0.02 < found.height_std_m < 0.03
    assert (other.height_m, other.height_std_m) == (None, None)
