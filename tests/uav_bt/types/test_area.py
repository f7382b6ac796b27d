"""Areas: distance to the boundary, intersections, and polygons that are none."""

from __future__ import annotations

import pytest

from tests.worlds.tables import cases
from uav_bt.errors import ValueRangeError
from uav_bt.types.area import Area

CASES = cases("values")

SQUARE = ((-1.0, -2.0), (3.0, -2.0), (3.0, 2.0), (-1.0, 2.0))
CORNER = ((0.0, 0.0), (4.0, 0.0), (4.0, 1.0), (1.0, 1.0), (1.0, 4.0), (0.0, 4.0))  # an L


@pytest.mark.parametrize(("at_m", "margin_m"), CASES["margins"])
def test_the_margin_is_the_distance_to_the_boundary(
    at_m: tuple[float, float], margin_m: float
) -> None:
    assert Area((SQUARE,)).margin_m(*at_m) == pytest.approx(margin_m)
    assert Area((SQUARE[::-1],)).margin_m(*at_m) == pytest.approx(margin_m)


def test_a_concave_area_has_its_notch_outside() -> None:
    area = Area((CORNER,))
    assert area.margin_m(2.0, 2.0) == pytest.approx(-1.0)
    assert area.margin_m(0.5, 3.0) == pytest.approx(0.5)


def test_of_two_areas_both_hold() -> None:
    area = Area((SQUARE, CORNER))
    assert area.margin_m(-0.5, 0.0) < 0.0
    assert area.margin_m(3.5, 0.5) < 0.0
    assert area.margin_m(2.0, 0.5) == pytest.approx(0.5)


@pytest.mark.parametrize(("polygons", "words"), CASES["refused_areas"])
def test_what_is_no_polygon_is_refused(
    polygons: tuple[tuple[tuple[float, float], ...], ...], words: str
) -> None:
    with pytest.raises(ValueRangeError, match=words):
        Area(polygons)
