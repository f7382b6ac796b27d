"""The measurement of landing marks: errors of views, and which flights are missing."""

from __future__ import annotations

import math

import pytest

from benchmarks import landing_marks
from uav_bt.plugins import make_mark_finder


@pytest.mark.parametrize("name", landing_marks.MARKS)
def test_each_mark_can_be_made_and_stands_in_its_scenes(name: str) -> None:
    mark = landing_marks.mark_of(name)
    scene = landing_marks.scene_of(mark, seed=3)

    assert make_mark_finder(mark) is not None
    assert scene.mark == mark
    assert math.dist(scene.start_m, landing_marks.CENTRE_M) >= 2.0


def test_a_view_from_above_has_hardly_an_error() -> None:
    found = landing_marks.sightings(landing_marks.mark_of("apriltag-0"), 1.5, 60.0, 2)

    assert len(found.range_m) == found.views == 2
    assert max(map(abs, found.range_m)) < 0.01
    assert max(map(abs, found.heading_deg)) < 0.5
    assert found.row().startswith(" 100 %")


def test_flights_in_the_file_are_not_flown_again() -> None:
    flown = [{"mark": "a", "seed": 0}, {"mark": "b", "seed": 1}]

    assert list(landing_marks.missing_flights(["a", "b"], 2, flown)) == [("a", 1), ("b", 0)]
