"""Ids of objects through a mission, and their heights."""

import math

import numpy as np
import pytest

from perception.mapping.known_objects import KnownObjects
from uav_bt.types import Pose2D
from uav_bt.types.site_map import MapObject


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


def edges(known: KnownObjects, heights_m: list[float], x_m: float = 0.2, class_id: int = 4) -> None:
    """Let a view show upper edges above one place."""
    places_m, ids = np.array([(x_m, 0.0)] * len(heights_m)), np.full(len(heights_m), class_id)
    known.see_edges(places_m, ids.astype(np.uint8), np.array(heights_m))


def test_the_height_is_the_median_over_bearings_and_views() -> None:
    known = KnownObjects()
    for height_m in (0.80, 0.82, 0.84, 3.0, 0.81):
        edges(known, [height_m, math.nan, height_m, height_m + 1.0, height_m])
        (found,) = known.named([box(0.0)])
    assert found.height_m == pytest.approx(0.82)
    assert 0.02 < found.height_std_m < 0.03


def test_without_enough_edges_of_its_own_an_object_has_no_height() -> None:
    """A height outlives the time in which its object is gone."""
    known = KnownObjects()
    edges(known, [0.8, math.nan, 0.8])
    edges(known, [0.8] * 9, x_m=0.5)
    edges(known, [0.8] * 9, class_id=5)
    (found,) = known.named([box(0.0)])
    assert found.height_m is None
    assert found.height_std_m is None
    edges(known, [0.8] * 3)
    known.named([box(0.0)])
    known.named([])
    assert known.named([box(0.0)])[0].height_m == 0.8
