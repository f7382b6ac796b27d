"""Ids of objects through a mission, and their heights."""

from __future__ import annotations

import math
from collections.abc import Sequence
from random import Random

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from perception.mapping.known_objects import KnownObjects
from uav_bt.types import Pose2D
from uav_bt.types.site_map import MapObject


def box(x_m: float, y_m: float = 0.0, class_id: int = 4) -> MapObject:
    return MapObject(
        class_id=class_id, x_m=x_m, y_m=y_m, size_m=0.4, width_m=0.4, std_m=0.1, seen_s=1.0
    )


def ids(objects: Sequence[MapObject]) -> list[int]:
    return [each.id for each in objects]


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
        assert ids(known.named([box(x_m) for x_m in places])) == list(places.values())


def test_an_object_of_another_class_is_another_object() -> None:
    known = KnownObjects()
    assert ids(known.named([box(0.0), box(0.0, class_id=5)])) == [1, 2]
    assert ids(known.named([box(0.1, class_id=5), box(-0.1), box(0.0, class_id=6)])) == [2, 1, 3]


def test_after_a_restart_objects_are_found_in_the_frame_of_the_new_map() -> None:
    known = KnownObjects()
    known.named([box(1.0, 0.0), box(2.0, 0.0)])
    correction = Pose2D(x_m=0.5, y_m=-0.3, yaw_rad=math.radians(90))
    known.restart(correction)
    moved = [box(*correction.to_body(x_m + 0.3, 0.2)) for x_m in (2.0, 1.0)]
    assert ids(known.named(moved)) == [2, 1]


PLACES = [(x, y) for x in (-1.5, 0.0, 1.5) for y in (-1.5, 0.0, 1.5)]


@given(
    st.lists(
        st.dictionaries(
            st.integers(0, len(PLACES) - 1),
            st.tuples(st.floats(-0.12, 0.12), st.floats(-0.12, 0.12)),
        ),
        max_size=12,
    ),
    st.randoms(use_true_random=False),
)
def test_each_place_has_one_id(
    searches: list[dict[int, tuple[float, float]]], order: Random
) -> None:
    """Objects of one class come and go, in any order, each within 12 cm of its place."""
    known, id_of = KnownObjects(), dict[int, int]()
    for search in searches:
        places = list(search)
        order.shuffle(places)
        found = [
            box(PLACES[place][0] + search[place][0], PLACES[place][1] + search[place][1])
            for place in places
        ]
        named = known.named(found)
        assert [(each.x_m, each.y_m) for each in named] == [(each.x_m, each.y_m) for each in found]
        for place, each in zip(places, named, strict=True):
            assert id_of.setdefault(place, each.id) == each.id
    assert sorted(id_of.values()) == list(range(1, len(id_of) + 1))


def edges(
    known: KnownObjects, heights_m: list[float], *, x_m: float = 0.2, class_id: int = 4
) -> None:
    """Let a view show upper edges above one place."""
    count = len(heights_m)
    known.see_edges(
        np.full((count, 2), (x_m, 0.0)),
        np.full(count, class_id, dtype=np.uint8),
        np.array(heights_m),
    )


def test_the_height_is_the_median_over_bearings_and_views() -> None:
    known = KnownObjects()
    for height_m in (0.80, 0.82, 0.84, 3.0, 0.81):
        edges(known, [height_m, math.nan, height_m, height_m + 1.0, height_m])
        (found,) = known.named([box(0.0)])
    assert found.height_m == pytest.approx(0.82)
    assert found.height_std_m is not None
    assert 0.02 < found.height_std_m < 0.03


def test_without_enough_edges_of_its_own_an_object_has_no_height() -> None:
    known = KnownObjects()
    edges(known, [0.8, math.nan, 0.8])
    edges(known, [0.8] * 9, x_m=0.5)
    edges(known, [0.8] * 9, class_id=5)
    (found,) = known.named([box(0.0)])
    assert found.height_m is None
    assert found.height_std_m is None


def test_a_height_outlives_the_time_in_which_its_object_is_gone() -> None:
    known = KnownObjects()
    edges(known, [0.8] * 3)
    known.named([box(0.0)])
    known.named([])
    assert known.named([box(0.0)])[0].height_m == 0.8
