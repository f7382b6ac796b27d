"""Places as tree files write them."""

from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.worlds.tables import cases
from uav_bt.errors import ValueRangeError
from uav_bt.types.place import Place, PlaceFrame, parse_places

CASES = cases("values")


@pytest.mark.parametrize(("text", "given"), CASES["places"])
def test_a_place_of_a_text(text: str, given: dict[str, Any]) -> None:
    frame = PlaceFrame(given["frame"])
    assert Place.parse(text) == Place(**{**given, "frame": frame})


@pytest.mark.parametrize(
    ("text", "words"),
    [
        *CASES["refused_places"],
        *((text, "such as start:2,0 ") for text in ("object:3,1", "object:" + 5000 * "9")),
        ("start:1,0@" + 400 * "9", "a heading in degrees"),
    ],
)
def test_other_texts_are_refused_with_an_example(text: str, words: str) -> None:
    with pytest.raises(ValueRangeError, match=words):
        Place.parse(text)


def test_a_list_keeps_its_order() -> None:
    places = parse_places("start:1,0; mark ;lab:0.5,0.5@180;")
    assert [place.frame.value for place in places] == ["start", "mark", "lab"]
    with pytest.raises(ValueRangeError, match="empty list"):
        parse_places(" ; ")


@given(
    frame=st.sampled_from(["start", "body", "lab"]),
    x_cm=st.integers(-99_999, 99_999),
    y_cm=st.integers(-99_999, 99_999),
    heading_deg=st.none() | st.integers(-179, 179),
)
def test_a_place_is_read_as_it_is_written(
    frame: str, x_cm: int, y_cm: int, heading_deg: int | None
) -> None:
    place = Place(
        frame=PlaceFrame(frame),
        x_m=x_cm / 100,
        y_m=y_cm / 100,
        heading_rad=None if heading_deg is None else math.radians(heading_deg),
    )
    again = Place.parse(str(place))
    assert (again.x_m, again.y_m) == pytest.approx((place.x_m, place.y_m))
    assert (again.heading_rad is None) == (place.heading_rad is None)
    if again.heading_rad is not None and place.heading_rad is not None:
        assert again.heading_rad == pytest.approx(place.heading_rad)
